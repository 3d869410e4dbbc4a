(() => {
  const $ = (query, root = document) => root.querySelector(query), data = JSON.parse($("#data").textContent);
  const make = (tag, text, name) => { const found = document.createElement(tag); if (text !== undefined) found.textContent = text; if (name) found.className = name; return found; };
  const collator = new Intl.Collator("en", { numeric: true }), columns = new Map();

  // A column has the text and the sort key of each row; distinct texts are compared once.
  for (const raw of data.columns) {
    if (raw.numbers) {
      const keys = Float64Array.from(raw.numbers, (v) => (v === null ? NaN : v));
      columns.set(raw.name, { numeric: true, keys, text: (row) => (raw.numbers[row] === null ? "–" : String(raw.numbers[row])) });
      continue;
    }
    const places = raw.places || raw.texts.map((_, k) => k), order = raw.texts.map((_, k) => k).sort((a, b) => collator.compare(raw.texts[a], raw.texts[b]));
    const rank = new Int32Array(raw.texts.length), lower = raw.texts.map((text) => text.toLowerCase());
    order.forEach((k, place) => { rank[k] = place; });
    const column = { texts: raw.texts, places, lower, order, keys: Float64Array.from(places, (k) => (k < 0 ? NaN : rank[k])), text: (row) => (places[row] < 0 ? "–" : raw.texts[places[row]]) };
    if (raw.seeded) { const plain = column.text, seed = columns.get("seed"); column.text = (row) => (places[row] < 0 ? "–" : `${plain(row)} --seed ${seed.text(row)}`); }
    columns.set(raw.name, column);
  }
  const text = (name, row) => (columns.has(name) ? columns.get(name).text(row) : "–"), good = (row) => data.good[row] === 1;
  const words = (row) => text("outcome", row).replaceAll("_", " ");
  const badge = (row) => make("span", words(row) + (text("outcome", row) === "succeeded" && !good(row) ? ", not certified" : ""), "badge" + (good(row) ? " good" : /^(collided|invalid_plan)|failed$/.test(text("outcome", row)) ? " hit" : ""));
  const planners = columns.get("planner"), numbers = new Map(data.planners.map((label, k) => [label, k]));
  const chip = (label) => { const found = make("span", undefined, "chip"); found.style.background = `var(--planner-${numbers.get(label) ?? 0})`; return found; };

  const linksOf = (row) => (data.views[row] ? [["drive", data.views[row]]] : []);
  const linked = ([name, href]) => { const found = make("a", name); found.href = href; return found; };

  // The runs: a sorted list of row numbers; the document holds the visible ones only.
  const HEIGHT = 34, box = $("#runs"), body = $("tbody", box), heads = [];
  const shown = (name, row) => { const value = text(name, row); return columns.get(name).numeric && /[._]/.test(name) && value !== "–" ? String(Number(Number(value).toPrecision(4))) : value; };
  let sorted = Uint32Array.from({ length: data.rows }, (_, k) => k), visible = sorted, drawn = "";
  const cell = (name, row) => {
    const found = make("td", undefined, columns.get(name).numeric ? "n" : "");
    const [view] = name === "world" ? linksOf(row) : [];
    if (view) found.append(linked([text(name, row), view[1]]));
    else if (name === "outcome") found.append(badge(row));
    else if (name === "planner") found.append(chip(text(name, row)), text(name, row));
    else found.textContent = shown(name, row);
    found.title = found.textContent;
    return found;
  };
  const gap = (rows) => { const line = make("tr", undefined, "gap"), filler = make("td"); filler.colSpan = data.shown.length; line.style.height = filler.style.height = `${rows * HEIGHT}px`; line.append(filler); return line; };
  const draw = () => {
    const first = Math.max(0, Math.floor(box.scrollTop / HEIGHT) - 8), last = Math.min(visible.length, first + Math.ceil(box.clientHeight / HEIGHT) + 16);
    const state = `${first} ${last}`;
    if (state === drawn) return;
    drawn = state;
    const lines = document.createDocumentFragment();
    lines.append(gap(first));
    for (let k = first; k < last; k++) { const line = make("tr"); line.dataset.row = visible[k]; line.tabIndex = 0; for (const name of data.shown) line.append(cell(name, visible[k])); lines.append(line); }
    lines.append(gap(visible.length - last));
    const focused = body.contains(document.activeElement) && document.activeElement.dataset.row;
    body.replaceChildren(lines);
    if (focused) $(`tr[data-row="${focused}"]`, body)?.focus({ preventScroll: true });
  };
  const redraw = () => { drawn = ""; draw(); };
  const sort = (name, down) => {
    const { keys } = columns.get(name), sign = down ? -1 : 1;
    sorted.sort((a, b) => { const x = keys[a], y = keys[b]; return x === x && y === y ? sign * (x - y) || a - b : (x !== x) - (y !== y) || a - b; });
    heads.forEach((head) => head.setAttribute("aria-sort", head.dataset.name !== name ? "none" : down ? "descending" : "ascending"));
    filter();
  };
  const test = (word) => {
    const found = /^([\w.]+)(<=|>=|<|>|=)(-?[\d.]+)$/.exec(word), column = found && (columns.get(found[1]) || columns.get(`option.${found[1]}`));
    if (column && column.numeric) {
      const limit = Number(found[3]), compare = { "<": (v) => v < limit, ">": (v) => v > limit, "<=": (v) => v <= limit, ">=": (v) => v >= limit, "=": (v) => v === limit }[found[2]];
      return (row) => compare(column.keys[row]);
    }
    const fits = [...new Set([...data.shown, "task", "robot", "reason", "key"])].filter((name) => columns.has(name) && columns.get(name).texts).map((name) => {
      const { lower, places } = columns.get(name), hit = Uint8Array.from(lower, (value) => value.includes(word) || value.replaceAll("_", " ").includes(word));
      return (row) => places[row] >= 0 && hit[places[row]];
    });
    return (row) => fits.some((fit) => fit(row));
  };
  const filter = () => {
    const tests = $("#filter").value.toLowerCase().split(/\s+/).filter(Boolean).map(test), planner = $("#planner").value, outcome = $("#outcome").value;
    if (planner) tests.push((row) => text("planner", row) === planner);
    if (outcome) tests.push(outcome === "failed" ? (row) => !good(row) : (row) => text("outcome", row) === outcome);
    visible = tests.length ? sorted.filter((row) => tests.every((fits) => fits(row))) : sorted;
    $("#count").textContent = `${visible.length.toLocaleString("en")} of ${data.rows.toLocaleString("en")} runs`;
    box.scrollTop = 0;
    redraw();
  };
  for (const name of data.shown) {
    const head = make("th", undefined, columns.get(name).numeric ? "n" : ""), button = make("button", data.titles[name]);
    button.type = "button"; head.scope = "col"; head.dataset.name = name; head.setAttribute("aria-sort", "none"); head.append(button);
    button.addEventListener("click", () => sort(name, head.getAttribute("aria-sort") === "ascending"));
    heads.push(head); $("thead tr", box).append(head);
  }
  for (const label of planners.order.map((k) => planners.texts[k])) $("#planner").append(make("option", label));
  const outcomes = columns.get("outcome"), failed = make("option", "all failures"); failed.value = "failed"; $("#outcome").append(failed);
  for (const key of outcomes.order.map((k) => outcomes.texts[k])) { const option = make("option", key.replaceAll("_", " ")); option.value = key; $("#outcome").append(option); }
  box.addEventListener("scroll", draw, { passive: true });
  new ResizeObserver(redraw).observe(box);
  $("#filter").addEventListener("input", filter); $("#planner").addEventListener("change", filter); $("#outcome").addEventListener("change", filter);

  // Details of runs, in a dialog.
  const dialog = $("#details");
  const repeat = (row) => {
    const found = document.createDocumentFragment(), command = text("command", row), log = text("rollout", row);
    if (command !== "–") found.append(make("pre", command));
    if (log !== "–") found.append(linked([log, data.base + log.split("/").map(encodeURIComponent).join("/")]));
    const files = make("p");
    for (const link of linksOf(row)) files.append(linked(link), " ");
    if (files.hasChildNodes()) found.append(files);
    return found;
  };
  const open = (...parts) => { $("div", dialog).replaceChildren(...parts); dialog.showModal(); dialog.scrollTop = 0; };
  const sentence = (row) => { const plain = data.sentences[text("outcome", row)] || words(row), why = text("reason", row); return plain[0].toUpperCase() + plain.slice(1) + (why === "–" || why === "" ? "." : ` (${why}).`); };
  const details = (row) => {
    const list = make("dl");
    for (const [name] of columns) if (!["command", "rollout", "reason"].includes(name) && text(name, row) !== "–") { const entry = make("div"); entry.append(make("dt", data.titles[name]), make("dd", text(name, row))); list.append(entry); }
    const found = data.details[row], why = make("ul", undefined, "why");
    for (const reason of found ? found.why : []) why.append(make("li", reason));
    open(make("h3", `${text("world", row)} · ${text("planner", row)} · seed ${text("seed", row)}`), badge(row), make("p", found ? found.told : sentence(row)), why, repeat(row), list);
  };
  const chosen = (event) => { const line = event.target.closest("tr[data-row]"); if (line && !event.target.closest("a")) details(Number(line.dataset.row)); };
  body.addEventListener("click", chosen);
  body.addEventListener("keydown", (event) => {
    const next = event.target.matches("tr") && { ArrowDown: event.target.nextElementSibling, ArrowUp: event.target.previousElementSibling }[event.key];
    if (next && next.dataset.row) { event.preventDefault(); next.focus(); }
    else if (event.key === "Enter") chosen(event);
  });

  // World by planner: a deeper colour for more failures.
  const matrix = (grid) => {
    const worlds = columns.get("world"), labels = data.planners, cells = new Map();
    for (let row = 0; row < data.rows; row++) { const key = `${worlds.places[row]}\n${text("planner", row)}`; if (!cells.has(key)) cells.set(key, []); cells.get(key).push(row); }
    const failures = (world, label, rows) => {
      const bad = rows.filter((row) => !good(row)), parts = [make("h3", `${world} · ${label}: ${bad.length} of ${rows.length} runs failed`)];
      for (const row of bad.slice(0, 50)) { const part = make("section"), title = make("p", `Seed ${text("seed", row)}${columns.has("task") && text("task", row) !== "own" ? `, ${text("task", row)}` : ""}: `); title.append(badge(row)); part.append(title, make("p", sentence(row), "small"), repeat(row)); parts.push(part); }
      if (bad.length > 50) parts.push(make("p", `${bad.length - 50} more: filter the table below.`));
      if (bad.length) parts.splice(1, 0, make("p", "Run commands in the campaign's folder.", "small"));
      open(...parts);
    };
    const head = make("tr"), corner = make("th", "world"); corner.scope = "col"; head.append(corner);
    for (const label of labels) { const found = make("th"); found.scope = "col"; found.append(make("span", label)); head.append(found); }
    grid.createTHead().append(head);
    const lines = grid.createTBody(), share = (rows) => rows.filter(good).length / rows.length;
    const rowsOf = (k, label) => cells.get(`${k}\n${label}`) || [];
    for (const k of worlds.order.slice(0, 500)) {
      const line = lines.insertRow(), name = make("th", worlds.texts[k]); name.scope = "row"; name.title = worlds.texts[k]; line.append(name);
      for (const label of labels) {
        const rows = rowsOf(k, label), place = line.insertCell();
        if (!rows.length) { place.textContent = "–"; continue; }
        const button = make("button", `${rows.filter(good).length}/${rows.length}`, share(rows) === 1 ? "full" : "");
        button.type = "button"; button.setAttribute("aria-label", `${worlds.texts[k]}, ${label}: ${button.textContent} succeeded`);
        button.style.background = `color-mix(in srgb, var(--heat) ${Math.round(85 * (1 - share(rows)))}%, var(--pale))`;
        button.addEventListener("click", () => failures(worlds.texts[k], label, rows)); place.append(button);
      }
    }
    if (worlds.texts.length > 500) { const more = lines.insertRow().insertCell(); more.colSpan = labels.length + 1; more.textContent = `${worlds.texts.length - 500} more worlds are in the table of runs.`; }
  };
  if ($("#matrix")) matrix($("#matrix"));

  // Pairs of one measure, of one planner, or with a better planner.
  const choosePairs = () => {
    const against = $("#against").value, decided = $("#decided").checked;
    for (const part of document.querySelectorAll(".pairs")) {
      part.hidden = part.dataset.measure !== $("#measure").value;
      for (const line of part.querySelectorAll("tbody tr")) { const [first, second] = line.cells; line.hidden = (against && first.textContent !== against && second.textContent !== against) || (decided && line.cells[2].textContent === "–"); }
    }
  };
  if ($("#measure")) for (const id of ["#measure", "#against", "#decided"]) $(id).addEventListener("change", choosePairs);

  // Pressing a planner in the legend highlights its curves.
  const pressed = new Set();
  for (const button of document.querySelectorAll(".legend button")) button.addEventListener("click", () => {
    const k = button.dataset.planner, on = !pressed.delete(k);
    if (on) pressed.add(k);
    button.setAttribute("aria-pressed", String(on));
    for (const curve of document.querySelectorAll(".charts g[class^=planner-]")) curve.style.opacity = !pressed.size || pressed.has(curve.getAttribute("class").slice(8)) ? 1 : 0.12;
  });
  filter();
})();
