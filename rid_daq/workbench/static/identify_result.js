// The result of an identification, of a validation: sections of a run's result, as elements.
import { element, table } from "./dom.js";
import { findingList, gradeOf, measured, number, verdictOf } from "./work.js";

const told = (text) => ({ passed: null, text });

export function estimateParts(result) {
  const { estimate, comparison } = result;
  const bad = estimate.axes.filter((axis) => axis.grade === "bad");
  const mistakes = estimate.mistakes ?? [];
  const parts = [verdict(bad, mistakes)];
  parts.push(...mistakes.map(mistakePart));
  parts.push(element("h3", {}, "How well the model explains each axis"), gradeTable(estimate.axes));
  const notes = [...(estimate.findings ?? []), ...(result.notes ?? [])];
  if (estimate.mistakes && !mistakes.length) notes.push("No common mistake of wiring, units or files explains the data far better.");
  if (notes.length) parts.push(findingList(notes.map(told)));
  parts.push(element("p", {}, estimate.sentence));
  if (estimate.unseen.length) parts.push(element("p", {}, `Without any effect on the torques: ${estimate.unseen.join(", ")}.`));
  if (comparison) parts.push(...comparisonParts(comparison));
  parts.push(parametersPart(estimate.parameters));
  return parts;
}

function verdict(bad, mistakes) {
  if (bad.length)
    return verdictOf({
      passed: false,
      headline: `The model does not explain the torque of ${bad.map((axis) => axis.joint).join(", ")}`,
      sentence: "It is not exported. Look at the findings, correct the files, then identify again.",
    });
  if (mistakes.length)
    return verdictOf({
      passed: false,
      headline: "A file of this run is probably wrong",
      sentence: "Change what the finding names, record the run again, then identify again.",
    });
  return verdictOf({ passed: true, headline: "The model explains every axis", sentence: "Next: validate it on a run that was not used here." });
}

function mistakePart(mistake) {
  const others = mistake.alternatives.map((each) => each.words);
  return element("div", { class: "verdict bad" },
    element("p", {}, element("b", {}, mistake.sentence)),
    element("p", {}, `Change ${mistake.change.join(" or ")}, then record the run again.`),
    mistake.places?.length ? element("ul", {}, ...mistake.places.map((each) => element("li", {}, element("code", {}, each.words)))) : null,
    others.length ? element("p", {}, `As good an explanation: ${others.join("; ")}.`) : null);
}

function gradeTable(axes) {
  const rows = axes.map((axis) => [
    axis.joint, gradeOf(axis.grade), axis.reason ?? "–", `${number(axis.torque, 3)} ${axis.unit}`,
    `${number(axis.residual, 3)} ${axis.unit}`, `${number(axis.percent, 3)} %`,
    axis.over_noise === null || axis.over_noise === undefined ? "–" : `${number(axis.over_noise, 2)} times`,
  ]);
  const columns = ["axis", "fit", "why", "torque (RMS)", "residual (RMS)", "of torque", "over noise"];
  return table(columns, rows, null, "fit of each axis");
}

function comparisonParts(comparison) {
  const rows = comparison.joints.map((joint) => [joint, comparison.chosen[joint].join(", ")]);
  return [element("h3", {}, "Friction terms chosen by data"), table(["axis", "terms"], rows, null, "chosen friction terms")];
}

function parametersPart(parameters) {
  const rows = parameters.map((each) => {
    const [value, reach] = measured(each.value, each.at_bound || each.not_shown ? null : 2 * each.std);
    return [each.words, value, each.at_bound ? "at its bound: not shown by the data" : each.not_shown ? "not shown by the data" : `± ${reach}`, each.unit];
  });
  return element("details", {}, element("summary", {}, `${parameters.length} parameters with 95 % intervals`),
    table(["parameter", "value", "2σ", "unit"], rows, null, "parameters"));
}

export function validationParts(result) {
  const { validation, verdict: judged } = result;
  const rows = validation.axes.map((axis) => [
    axis.joint, gradeOf(axis.grade), `${number(axis.rms_torque, 3)} ${axis.unit}`, `${number(axis.rms_error, 3)} ${axis.unit}`,
    `${number(axis.relative_error_percent, 3)} %`, axis.limit_percent === null ? "–" : `${axis.limit_percent} %`,
    axis.passed === null ? "–" : axis.passed ? "holds" : "does not hold",
  ]);
  const columns = ["axis", "fit", "torque (RMS)", "error (RMS)", "error", "limit", ""];
  const parts = [verdictOf(judged), table(columns, rows, validation.axes.map((axis) => axis.passed === false), "validation of each axis")];
  if (validation.diagnosis?.length) parts.push(findingList(validation.diagnosis.map(told)));
  parts.push(element("p", {}, validation.sentence));
  return parts;
}
