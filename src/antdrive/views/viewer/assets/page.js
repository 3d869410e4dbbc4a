// The page: verdict, answers, controls, address. It begins paused at the closest moment.
const $ = (id) => document.getElementById(id), SPEEDS = [0.25, 0.5, 1, 2, 4], LEAST = 0.4;
const make = (tag, about = {}, ...inside) => { const one = Object.assign(document.createElement(tag), about); one.append(...inside); return one; };

class Page {
  async start() {
    this.drives = await Promise.all([...document.querySelectorAll("script.drive")].map(async (one) =>
      new Drive(await unpacked(one.textContent.trim()), one.classList.contains("line"))));
    this.drive = this.drives[0];
    try {
      this.scene = new Scene($("scene"), this.drives);
    } catch (error) {
      $("view").dataset.flat = "This browser offers no WebGL2; the curve and the answers work without the scene.";
    }
    [this.share, this.end] = [1, Math.max(...this.drives.map((drive) => drive.end))];
    this.scrubber = new Scrubber($("curve"), this.drives, (t) => { this.pause(); this.seek(t); });
    this.wire();
    this.choose(this.drive);
    this.read(location.hash);
    document.documentElement.dataset.painted = performance.now().toFixed(0);
    await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
    this.scene?.know();
    this.paint();
    for (const drive of this.drives.filter((one) => !one.stated.line)) {
      drive.checks = await drive.check();
      this.tell();
    }
    document.documentElement.dataset.checked = performance.now().toFixed(0);
  }

  choose(drive) {
    const changed = this.scene && drive !== this.drive;
    this.drive = drive;
    this.scrubber.choose(drive);
    if (changed) {
      this.scene.choose(drive);
      this.scene.know();
    }
    this.tell();
    $("bodies").replaceChildren(make("option", {value: "-1", textContent: "choose an obstacle"}), ...Array.from({length: drive.things}, (_, j) =>
      make("option", {value: j, textContent: drive.name(j)})));
    this.pick(-1);
    this.seek(drive.time(drive.closest));
  }
  // Show verdict, answers and proof of the chosen drive.
  tell() {
    const {drive} = this, {record, stated, checks} = drive, {certificate, line} = stated, done = record.outcome === "succeeded";
    const failed = checks && Object.entries(checks).filter(([key, good]) => good === false && key !== "value").map(([key]) => key);
    const forged = failed?.some((key) => key === "digest") || (certificate.certified && failed?.length);
    const proved = certificate.certified && !failed?.length, row = drive.closest, touched = drive.contacts.length, t = drive.time(row);
    let mark = forged || touched ? "✕" : (proved || line) && done ? "✓" : "!", text = ended(record.outcome);
    if (touched) text = `${record.outcome === "collided" ? "Touched" : text + ":"} ${drive.name(drive.contacts[1])} at ${seconds(t)}`;
    if (stated.claim) [mark, text] = stated.claim;
    else if (forged) text = `Do not trust this page: its ${failed.join(" and ")} ${failed.length > 1 ? "do" : "does"} not match its log`;
    else text += proved ? `. Never closer than ${atLeast(certificate.bound_m)} (proved)` : touched || line ? "" : ". Not proved free of contact";
    if (stated.faults?.length) [mark, text] = ["✕", `Test failed. ${text}`];
    $("verdict").textContent = `${mark} ${this.drives.length > 1 ? stated.label + ": " : ""}${text}.`;
    $("verdict").className = mark === "✓" ? "good" : mark === "!" ? "doubt" : "bad";
    const {task, robot, seed} = record, near = drive.nearest(row), slow = drive.slowest();
    $("about").textContent = [`world ${task.name}`, `planner ${record.planner.name}`, `robot ${robot.name}`, `seed ${seed}`,
      drive.mapless ? "without a map" : ""].filter(Boolean).join(" · ");
    if (stated.about) $("about").textContent = stated.about;
    this.answer("closest", touched ? "First contact" : "Closest", `${drive.name(touched ? drive.contacts[1] : near.thing)} at ${seconds(t)}`, gap(drive.clearance[row]), t);
    if (slow) {
      const [from, to] = [drive.time(slow.from), drive.time(slow.to)];
      this.answer("slowest", "Slowest", words(slow.rule), `${from.toFixed(1)}–${seconds(to)}: ${slow.lost.toFixed(2)} m lost`, (from + to) / 2);
    } else this.answer("slowest", "Slowest", "no rule limited its speed for long", "", 0);
    $("slowest").hidden = Boolean(stated.claim);
    const sign = (good) => (good === undefined ? "…" : good === null ? "not computed" : good ? "✓" : "✕");
    const proof = ["physics", "geometry", "bound"].map((key) => `${key} ${sign(checks?.[key])}`).join(" ");
    this.answer("proof", "Proof", line ? stated.proof : proof, line ? "" : checks ? `digest recomputed ${sign(checks.digest)}` : "digest …", t);
    const parts = this.drives.map((one) => [drive.parts(one), one.stated.label]).filter(([at]) => at !== undefined);
    $("parts").hidden = !parts.length;
    if (parts.length) this.answer("parts", "Drives part", parts.map(([at, label]) => `${label} at ${seconds(at)}`).join(", "), "", Math.min(...parts.map(([at]) => at)));
    $("proof").title = line ? "" : `SHA-256 of the log: ${checks?.value || record.digest}`;
    $("problems").classList.toggle("soft", Boolean(stated.notes));
    $("problems").replaceChildren(...(stated.notes ?? [...stated.faults ?? [], ...certificate.problems]).map((problem) => make("li", {textContent: problem})));
    $("repeat").hidden = !($("command").textContent = stated.command);
    const note = (text) => make("span", {textContent: text});
    $("rules").replaceChildren(...[...new Set(drive.limiter)].filter((k) => record.limiters[k]).map((k) => {
      const chip = make("i");
      chip.style.background = ruleColour(drive, k);
      return make("span", {}, chip, words(record.limiters[k]));
    }), ...(record.replans.length ? [note("▾ replanned")] : []), ...(stated.seen?.some((t) => t) ? [note("| obstacle first seen")] : []),
      ...(stated.field ? [note(`blue ground: ${stated.field.name}`)] : []));
    $("drives").hidden = this.drives.length < 2;
    $("drives").replaceChildren(...this.drives.map((one) => {
      const chip = make("i"), {stated: its} = one;
      chip.style.background = this.scrubber.colour(one);
      const button = make("button", {type: "button", onclick: () => this.choose(one)}, chip,
        `${its.label} ${its.line ? "" : its.certificate.certified ? "≥ " + atLeast(its.certificate.bound_m) : "not proved"}`);
      button.setAttribute("aria-pressed", one === drive);
      return button;
    }));
  }

  answer(id, title, what, detail, t) {
    $(id).replaceChildren(make("b", {textContent: title}), make("small", {textContent: detail}), make("span", {textContent: what}));
    $(id).onclick = () => { this.pause(); this.seek(t); };
  }

  seek(t) {
    this.t = Math.max(0, Math.min(this.end, t));
    this.paint();
  }
  // Put the moment into the address and into words once it rests, and draw it sharply.
  settle() {
    const {drive} = this, row = drive.row(this.t), hash = `#t=${this.t.toFixed(3)}&cam=${this.scene?.camera.name ?? "follow"}`;
    if (location.hash !== hash) history.replaceState(null, "", hash);
    $("words").textContent = `At ${drive.time(row).toFixed(2)} seconds: ${this.clearance(row)}; speed ${this.speed(row)}, limited by ${words(drive.rule(row))}.`;
    this.paint(true);
  }

  clearance(row) {
    const {drive} = this, d = drive.clearance[row];
    return `${gap(d)} ${d < 0 ? "with" : "to"} ${drive.name(drive.nearest(row).thing)}`;
  }

  speed(row) { return `${Math.abs(this.drive.speed(row)).toFixed(2)} of ${+this.drive.record.robot.max_speed.toPrecision(3)} m/s${this.drive.speed(row) < -0.005 ? ", backwards" : ""}`; }

  paint(sharp) {
    if (document.documentElement.dataset.paper) return;  // what is printed stays as it is
    this.sharp = sharp;
    clearTimeout(this.later);
    if (!sharp && !this.playing) this.later = setTimeout(() => this.settle(), 250);
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => { this.asked = 0; this.frame(); });
  }

  frame() {
    const {drive, scene} = this, row = drive.row(this.t), tag = $("distance"), set = (id, text) => { if ($(id).textContent !== text) $(id).textContent = text; };
    if (scene) {
      // A processor that draws in place of a graphics card draws less finely, except at rest.
      const canvas = $("scene"), fine = Math.min(2, devicePixelRatio || 1);
      const ratio = scene.ratio = this.playing ? (SOFTWARE ? 1 : fine) * this.share : SOFTWARE ? 1 + (this.sharp === true) : fine;
      const [w, h] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
      scene.gl.share = this.playing ? this.share : 1;
      if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
      const near = scene.draw(row);
      tag.hidden = !near.at || !near.from;
      if (!tag.hidden) [tag.style.left, tag.style.top] = scene.beside(near).map((part) => `${(100 * part).toFixed(2)}%`);
    }
    this.scrubber.draw(this.t);
    set("distance", gap(drive.clearance[row]));
    set("clock", `${drive.time(row).toFixed(2)} s`);
    set("clearance", this.clearance(row));
    set("speed", this.speed(row));
    set("rule", `${words(drive.rule(row))}, ${drive.span(row).map((t) => t.toFixed(1)).join("–")}\u00a0s`);
    $("rule").parentNode.hidden = !drive.record.limiters.length;
    $("rule").style.setProperty("--chip", ruleColour(drive, drive.limiter[row]));
    const others = this.drives.filter((one) => one !== drive);
    $("apart").parentNode.hidden = !others.length;
    set("apart", others.map((one) => {
      const more = one.clearance[one.row(this.t)] - drive.clearance[row];
      return `${one.stated.label} ${drive.apart(row, one).toFixed(2)} m away, ${metres(Math.abs(more))} ${more < 0 ? "less" : "more"} clearance`;
    }).join("\n"));
    $("curve").setAttribute("aria-valuenow", this.t.toFixed(2));
    $("curve").setAttribute("aria-valuetext", `${drive.time(row).toFixed(2)} s, clearance ${gap(drive.clearance[row])}`);
  }

  play() {
    if (this.playing) return this.pause();
    if (this.t >= this.end - 1e-6) this.t = 0;
    this.showPlaying(true);
    let before, frames = 0, since;
    const step = (now) => {
      if (!this.playing) return;
      this.t = Math.min(this.end, this.t + (now - (before ?? now)) / 1000 * +$("pace").value);
      before = now;
      if (frames++ % 12 === 0) {
        const each = (now - (since ?? now - 240)) / 12;
        this.share = Math.max(LEAST, Math.min(1, this.share * (each > 30 ? 0.8 : each < 18 ? 1.1 : 1)));
        since = now;
      }
      this.frame();
      if (this.t >= this.end) this.pause();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  pause() {
    if (!this.playing) return;
    this.showPlaying(false);
    this.settle();
  }

  showPlaying(playing) {
    this.playing = playing;
    $("play").textContent = playing ? "❚❚" : "▶";
    $("play").setAttribute("aria-label", playing ? "Pause" : "Play");
  }

  view(name) {
    if (!this.scene || !CAMERAS.includes(name)) return;
    Object.assign(this.scene.camera, {name, turn: 0, zoom: 1, shift: [0, 0], tilt: 0.82});
    document.querySelectorAll("#cameras button[value]").forEach((one) => one.setAttribute("aria-pressed", one.value === name));
    this.seek(this.t);
  }
  // Tell about an obstacle or mover: nearest approach, first sight, and jumps to both.
  pick(j) {
    const {drive} = this, box = $("about-body");
    if (this.scene) this.scene.picked = j;
    $("bodies").value = j;
    box.replaceChildren();
    if (j >= 0) {
      const {row, least} = drive.approach(j), seen = drive.firstSeen(j), jump = (t) =>
        make("button", {type: "button", textContent: `at ${seconds(t)}`, onclick: () => { this.pause(); this.seek(t); }});
      box.append(make("b", {textContent: drive.name(j)}), ` nearest ${gap(least)} `, jump(drive.time(row)), "; ");
      box.append(...(typeof seen === "number" ? ["first seen ", jump(seen)] : [seen === null ? "never seen" : j < drive.given && !drive.mapless
        ? "on the robot's map from the start" : "no scans tell when it was seen"]));
    }
    this.paint();
  }

  read(hash) {
    const asked = new URLSearchParams(hash.slice(1)), t = asked.get("t");
    this.view(CAMERAS.includes(asked.get("cam")) ? asked.get("cam") : "follow");
    this.seek(t !== null && Number.isFinite(+t) ? +t : this.t);
    this.asked = cancelAnimationFrame(this.asked);
    this.frame();
  }

  wire() {
    $("play").onclick = () => this.play();
    $("pace").replaceChildren(...SPEEDS.map((x) => make("option", {value: x, textContent: `${x}×`, selected: x === 1})));
    document.querySelectorAll("#cameras button[value]").forEach((one) => { one.onclick = () => this.view(one.value); });
    $("bodies").onchange = () => this.pick(+$("bodies").value);
    for (const [id, text] of [["copy", () => $("command").textContent], ["link", () => location.href]]) $(id).onclick = async () => {
      const copied = await navigator.clipboard?.writeText(text()).then(() => true, () => false);
      $("words").textContent = $(id).textContent = copied ? "copied" : "cannot copy";
    };
    $("scans").hidden = !this.drives.some((drive) => drive.scans?.length);
    $("scans").onclick = () => {
      this.scene.scans = this.scene.scans === false;
      $("scans").setAttribute("aria-pressed", this.scene.scans);
      this.paint();
    };
    $("curve").setAttribute("aria-valuemax", this.end.toFixed(2));
    addEventListener("keydown", (event) => this.key(event));
    addEventListener("hashchange", (event) => this.read(new URL(event.newURL).hash));  // the address may have settled again
    const again = () => { this.scrubber.drawn = false; this.scene?.paint(); this.tell(); this.frame(); };
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
    for (const id of ["view", "curve"]) new ResizeObserver(() => this.paint()).observe($(id));
    addEventListener("beforeprint", () => {
      document.documentElement.dataset.paper = 1;
      this.sharp = true;
      again();
      const {width, height} = $("scene"), still = Object.assign($("still"), {width, height});  // paper takes what was shown before
      if (this.scene) still.getContext("2d").drawImage($("scene"), 0, 0);
      for (const [box, {width, height}] of [["view", still], ["chart", $("curve")]]) $(box).style.setProperty("--wide", width / height);
    });
    addEventListener("afterprint", () => { delete document.documentElement.dataset.paper; again(); });
    if (this.scene) this.drag($("scene"));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || ["SELECT", "INPUT"].includes(event.target.tagName)) return;
    const one = event.shiftKey ? 1 : 0.1, held = event.target.tagName === "BUTTON";
    const acts = {
      " ": held ? null : () => this.play(), Home: () => this.seek(0), End: () => this.seek(this.end),
      ArrowLeft: () => this.seek(this.t - one), ArrowRight: () => this.seek(this.t + one),
      PageDown: () => this.seek(this.t + 1), PageUp: () => this.seek(this.t - 1),
      c: () => this.view(CAMERAS[(CAMERAS.indexOf(this.scene?.camera.name) + 1) % CAMERAS.length]),
      m: () => this.seek(this.drive.time(this.drive.closest)),
    };
    if (!acts[event.key]) return;
    event.preventDefault();
    if (event.key !== " " && event.key !== "c") this.pause();
    acts[event.key]();
  }
  // Turn, shift and zoom the camera by mouse or fingers; a click asks about what is there.
  drag(canvas) {
    const held = new Map(), {camera} = this.scene;
    let moved = 0;
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, [event.clientX, event.clientY]);
      moved = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const last = held.get(event.pointerId);
      if (!last) return;
      const dx = event.clientX - last[0], dy = event.clientY - last[1], scale = this.scene.last.far / canvas.clientHeight * 0.62;
      moved += Math.abs(dx) + Math.abs(dy);
      if (held.size === 2) {
        const other = [...held].find(([id]) => id !== event.pointerId)[1], was = Math.hypot(last[0] - other[0], last[1] - other[1]);
        camera.zoom *= Math.hypot(event.clientX - other[0], event.clientY - other[1]) / Math.max(1, was);
      }
      if (held.size === 2 || event.buttons === 2 || event.shiftKey || camera.name === "top") {
        camera.shift[0] -= dx * scale / held.size;
        camera.shift[1] += dy * scale / held.size;
      } else {
        camera.turn -= dx * 0.006;
        camera.tilt = Math.max(0.12, Math.min(1.5, camera.tilt + dy * 0.005));
      }
      held.set(event.pointerId, [event.clientX, event.clientY]);
      this.paint();
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => {
      held.delete(event.pointerId);
      if (end === "pointerup" && moved < 5) this.pick(this.scene.pick(event.offsetX, event.offsetY, this.drive.row(this.t)));
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      camera.zoom = Math.max(0.2, Math.min(20, camera.zoom * Math.exp(-event.deltaY * 0.0012)));
      this.paint();
    }, {passive: false});
  }
}

const page = new Page();
page.start().catch((error) => {
  $("verdict").textContent = `✕ This page is damaged: its log cannot be read (${error.message}).`;
  $("verdict").className = "bad";
});
