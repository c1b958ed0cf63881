// Page Settings for administrators: devices, tokens, the log of user actions.
import { dialog } from "./dialog.js";
import { table } from "./blocks.js";
import { element, find, timeOf } from "./dom.js";
import { html, render } from "./lit.js";
import { ask } from "./service.js";

const code = find("pairing-code");
const ENDS = { never: "when revoked", unused: "30 days after its last use", service: "when the service ends" };

find("pairing").addEventListener("submit", async (event) => {
  event.preventDefault();
  const words = find("pairing-words");
  const confirmed = {
    code: code.value.replace(/\s/g, ""),
    name: find("pairing-name").value.trim(),
    role: /** @type {Api.Role} */ (find("pairing-role").value),
  };
  try {
    const token = await ask("POST", "/pairing/confirm", confirmed);
    words.className = "verdict good";
    words.textContent = `${token.name} has access as ${token.role}.`;
    find("pairing").reset();
    await Promise.all([showTokens(), showAudit()]);
  } catch (error) {
    words.className = "verdict bad";
    words.textContent = error.message;
  }
});

async function showTokens() {
  const tokens = await ask("GET", "/tokens");
  /** @type {(token: Api.Token) => Part} */
  const revoke = (token) => html`<button type="button" @click=${() => revokeToken(token)}>Revoke</button>`;
  const rows = tokens.map((token) => [
    token.name,
    token.role,
    token.person ? "person" : "program",
    timeOf(token.created_s),
    token.used_s ? timeOf(token.used_s) : "never",
    ENDS[token.ends],
    revoke(token),
  ]);
  render(table(["name", "role", "type", "created", "last used", "expires", "revoke"], rows, null, "tokens"), find("tokens"));
}

/** @type {(token: Api.Token) => Promise<void>} */
async function revokeToken(token) {
  const text = `${token.name} will have no access from now on.`;
  if (!(await dialog(`Revoke ${token.name}?`, [element("p", {}, text)], "Revoke", { danger: true }))) return;
  render([], find("revoke-problem"));
  await load("revoke-problem", async () => {
    await ask("DELETE", `/tokens/${encodeURIComponent(token.id)}`);
    await Promise.all([showTokens(), showAudit()]);
  });
}

find("token").addEventListener("submit", async (event) => {
  event.preventDefault();
  await load("token-secret", async () => {
    const wanted = { name: find("token-name").value.trim(), role: /** @type {Api.Role} */ (find("token-role").value) };
    const made = await ask("POST", "/tokens", wanted);
    render(html`<p>Token of ${made.name}. Copy it now: it is shown only once. rid-daq reads it from the environment variable RID_DAQ_TOKEN.</p>
      <p class="secret">${made.secret}</p>`, find("token-secret"));
    find("token").reset();
    await Promise.all([showTokens(), showAudit()]);
  });
});

const JOB_ID = /^job \w+ ?/; // part of the details that this page does not show

async function showAudit() {
  const entries = await ask("GET", "/audit?limit=100");
  const rows = entries.map((each) => [timeOf(each.at_s), each.who, each.what.replaceAll("_", " "), each.cell, each.details.replace(JOB_ID, "")]);
  render(table(["when", "who", "what", "cell", "details"], rows, null, "audit log"), find("audit"));
}

/** @type {(part: keyof PageElements, show: () => Promise<void>) => Promise<void>} */
async function load(part, show) {
  try {
    await show();
  } catch (error) {
    render(html`<p class="problem">${error.message}</p>`, find(part));
  }
}

load("tokens", showTokens);
load("audit", showAudit);
