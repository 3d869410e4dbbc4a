// Scores of search results: words in a page's title count most, then in a section's title, then in the text.
// The kind of page only decides between equals; API, changelog, notebook and tables of figures come last.
const FOLDERS = { "how-to": 4, tutorials: 3, explanation: 3, reference: 2, _gallery: 1, benchmarks: -30, notebook: -100 };
const PATHS = { "reference/api/": -40, "reference/changelog": -100 };

// The share of the query's words that a title has, and of the title's words that the query has, of 1.
function agreement(title) {
  const stemmer = new Stemmer();
  const words = (text) => new Set(splitQuery(text.toLowerCase()).filter((w) => !stopwords.has(w)).map((w) => stemmer.stemWord(w)));
  const asked = words(new URLSearchParams(location.search).get("q") || ""), own = words(title);
  const both = [...asked].filter((word) => own.has(word)).length;
  return { asked: both / Math.max(asked.size, 1), own: both / Math.max(own.size, 1) };
}

var Scorer = {
  objNameMatch: 11,
  objPartialMatch: 0,
  objPrio: { 0: 0, 1: 0, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
  score: ([page, title, anchor, , score, , kind]) => {
    if (kind === "index" || kind === "object") return score / 10;
    const { asked, own } = agreement(kind === "title" && anchor ? title.split(" > ").pop() : title);
    const named = (asked === 1 ? 40 : 20 * asked) + 15 * own;
    const path = Object.keys(PATHS).find((start) => page.startsWith(start));
    const folder = path ? PATHS[path] : FOLDERS[page.split("/")[0]] || 0;
    return score + (anchor ? named / 2 : named) + folder;
  },
};
