// Scores of search results: guides first, then explanations, then the API.
const KINDS = { "how-to": 40, tutorials: 30, explanation: 20, reference: 10, notebook: -10 };
var Scorer = {
  objNameMatch: 11,
  objPartialMatch: 0,
  objPrio: { 0: 0, 1: 0, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
  score: ([page, , , , score, , kind]) => {
    if (kind === "index" || kind === "object") return score / 10;
    const folder = page.startsWith("reference/api") ? 0 : KINDS[page.split("/")[0]] || 0;
    return score + folder + (kind === "title" ? 25 : 0);
  },
};
