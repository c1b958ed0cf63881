// Shows the values of the joints relative to their limits, from the newest sample of a motion.

const DEGREES = 180 / Math.PI;
const OLD_S = 0.5;

/** @type {(value: number, unit: string) => string} */
const digits = (value, unit) => `${value.toPrecision(3)} ${unit}`;

/** @type {(section: HTMLElement, words: HTMLElement, picture: LivePicture) => void} */
export function showJoints(section, words, picture) {
  const { joints, age_s: age, moving } = picture;
  const old = age === null || age > OLD_S;
  const sentence = old && moving ? `NOT LIVE: no new values for ${age ?? "…"} s.` : `${picture.words}.`;
  say(words, sentence, old && moving);
  for (const joint of joints) {
    const card = section.querySelector(`[data-joint="${CSS.escape(joint.name)}"]`);
    if (card) showJoint(card, joint);
  }
}

/** @type {(words: HTMLElement) => void} */
export const showSilence = (words) => say(words, "NOT LIVE: no values arrive from the service.", true);
/** @type {(words: HTMLElement) => unknown} */
export const showReturn = (words) => words.classList.contains("problem") && say(words, "Values from before the connection was lost.", false);
/** @type {(words: HTMLElement) => void} */
export const showEnd = (words) => say(words, "Values at the end of the last motion.", false);

/** @type {(words: HTMLElement, sentence: string, problem: boolean) => void} */
function say(words, sentence, problem) {
  if (words.textContent !== sentence) words.textContent = sentence;
  words.classList.toggle("problem", problem);
}

// Show the drive temperatures of the preflight until a motion delivers new temperatures.
/** @type {(section: HTMLElement, lines: Api.CheckLine[]) => void} */
export function showTemperatures(section, lines) {
  for (const { where, temperature_c: warm } of lines) {
    if (warm === null || warm === undefined) continue;
    const card = section.querySelector(`[data-joint="${CSS.escape(where.split(",")[0])}"]`);
    const place = card?.querySelector('[data-show="temperature"]');
    if (place) place.textContent = `${warm.toFixed(0)} °C at the preflight`;
  }
}

/** @type {(card: Element, name: string) => HTMLElement} */
const part = (card, name) => /** @type {HTMLElement} */ (card.querySelector(`[data-show="${name}"]`));

/** @type {(card: Element, joint: LiveJoint) => void} */
function showJoint(card, joint) {
  const turns = joint.unit === "rad";
  const [unit, factor] = turns ? ["°", DEGREES] : ["mm", 1000];
  /** @type {(name: string, text: string, share: number) => void} */
  const set = (name, text, share) => {
    part(card, name).textContent = text;
    /** @type {HTMLProgressElement} */ (part(card, `${name}-bar`)).value = share;
  };
  /** @template Value @param {Value | null | undefined} value @returns {value is Value} */
  const known = (value) => value !== null && value !== undefined;
  card.classList.toggle("silent", joint.answers === false);
  if (known(joint.position)) {
    const { position_min: low, position_max: high } = joint;
    const [at, from, to] = [joint.position, low, high].map((value) => (factor * value).toFixed(1));
    set("position", `${at} ${unit} (${from} to ${to})`, (joint.position - low) / (high - low));
  }
  if (known(joint.velocity)) {
    const text = `${digits(factor * joint.velocity, `${unit}/s`)} of ${digits(factor * joint.velocity_limit, "")}`;
    set("velocity", text, Math.abs(joint.velocity) / joint.velocity_limit);
  }
  if (known(joint.torque)) {
    const text = `${digits(joint.torque, joint.torque_unit)} of ${digits(joint.torque_limit, "")}`;
    set("torque", text, joint.torque_share ?? Math.abs(joint.torque) / joint.torque_limit);
  }
  if (known(joint.following_error))
    set("error", digits(factor * joint.following_error, unit), joint.following_error_share ?? 0);
  part(card, "temperature").textContent = known(joint.temperature_c) ? `${joint.temperature_c.toFixed(0)} °C` : "";
}
