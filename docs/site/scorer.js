// Rank the search results: pages of guides and reference come before decision records and the pages "extending" and
// "faults".
var Scorer = {
  score: ([page, title, anchor, words, score]) => (/^(decisions\/|extending|faults)/.test(page) ? score - 40 : score),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
