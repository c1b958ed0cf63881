// Page for pairing a new device: it shows a code and asks the service regularly until an administrator has confirmed
// the code.
const POLL_MS = 1000;
const HEADERS = { "x-rid-daq": "page", "content-type": "application/json" };
const [code, words, again] = ["code", "words", "again"].map((id) => /** @type {HTMLElement} */ (document.getElementById(id)));

/** @template {"" | "/confirm" | "/state"} Path @param {Path} path @param {object} body @returns {Promise<Api.AnswerTo<"POST", Api.Parts<`/pairing${Path}`>>>} */
async function post(path, body) {
  const signal = AbortSignal.timeout(5000);
  const answer = await fetch(`/api/v1/pairing${path}`, { method: "POST", headers: HEADERS, body: JSON.stringify(body), signal });
  const content = await answer.json();
  if (!answer.ok) throw new Error(content.message);
  return content;
}

async function begin() {
  again.hidden = true;
  try {
    const begun = await post("", {});
    code.textContent = `${begun.code.slice(0, 3)} ${begun.code.slice(3)}`;
    words.textContent = "Waiting until an administrator types the code. It is valid for 5 minutes.";
    setTimeout(look, POLL_MS, begun.secret);
  } catch (error) {
    giveUp(error);
  }
}

/** @type {(secret: string) => Promise<void>} */
async function look(secret) {
  try {
    const state = await post("/state", { secret });
    if (state.confirmed) {
      words.textContent = "Confirmed.";
      if (state.key) localStorage.setItem("rid-daq session", state.key);
      location.replace("/");
      return;
    }
    setTimeout(look, POLL_MS, secret);
  } catch (error) {
    if (error instanceof TypeError || error.name === "TimeoutError") {
      words.textContent = "The service does not answer; trying again.";
      setTimeout(look, 2 * POLL_MS, secret);
    } else {
      giveUp(error);
    }
  }
}

/** @type {(error: Error) => void} */
function giveUp(error) {
  code.textContent = "– – –";
  words.textContent = `No code: ${error.message}`;
  again.hidden = false;
}

again.addEventListener("click", begin);
begin();
