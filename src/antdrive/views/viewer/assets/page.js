// The page: verdict, answers, controls, address. It begins paused at the closest moment.
const $ = (id) => document.getElementById(id), SPEEDS = [0.25, 0.5, 1, 2, 4];
const make = (tag, about = {}, ...inside) => { const one = Object.assign(document.createElement(tag), about); one.append(...inside); return one; };

class Page {
  async start() {
    const logs = await Promise.all([...document.querySelectorAll("script.drive")].map((one) => unpacked(one.textContent.trim())));
    this.drives = logs.map((log) => new Drive(log));
    this.drive = this.drives[0];
    try {
      this.scene = new Scene($("scene"), this.drives);
    } catch (error) {
      $("view").dataset.flat = "This browser offers no WebGL2; the curve and the answers work without the scene.";
    }
    this.end = Math.max(...this.drives.map((drive) => drive.end));
    this.scrubber = new Scrubber($("curve"), this.drives, (t) => { this.pause(); this.seek(t); });
    this.wire();
    this.choose(this.drive, true);
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

  choose(drive, first) {
    this.drive = drive;
    this.scrubber.choose(drive);
    if (this.scene && !first) {
      this.scene.choose(drive);
      this.scene.know();
    }
    this.tell();
    this.t = drive.time(drive.closest);
    const list = $("bodies");
    list.replaceChildren(make("option", {value: "-1", textContent: "choose an obstacle"}), ...Array.from({length: drive.things}, (_, j) =>
      make("option", {value: j, textContent: drive.name(j)})));
    const used = new Set(drive.limiter);
    $("rules").replaceChildren(...[...used].map((k) => {
      const chip = make("i");
      chip.style.background = ruleColour(drive, k);
      return make("span", {}, chip, words(drive.record.limiters[k] ?? "none"));
    }), ...(drive.record.replans.length ? [make("span", {textContent: "▾ replanned"})] : []));
    if (!first) this.seek(Math.min(this.t, this.end));
  }

  // Show verdict, answers and proof of the chosen drive.
  tell() {
    const {drive} = this, {record, stated, checks} = drive, {certificate} = stated, done = record.outcome === "succeeded";
    const failed = checks && Object.entries(checks).filter(([key, good]) => good === false && key !== "value").map(([key]) => key);
    const forged = failed?.some((key) => key === "digest") || (certificate.certified && failed?.length);
    const proved = certificate.certified && !failed?.length, row = drive.closest, touched = drive.contacts.length;
    const {line} = stated, mark = forged || touched ? "✕" : (proved || line) && done ? "✓" : "!";
    let text = OUTCOMES[record.outcome] ?? record.outcome;
    if (touched) text = `${record.outcome === "collided" ? "Touched" : text + ":"} ${drive.name(drive.contacts[1])} at ${seconds(drive.time(row))}`;
    if (forged) text = `Do not trust this page: its ${failed.join(" and ")} ${failed.length > 1 ? "do" : "does"} not match its log`;
    else text += proved ? `. Never closer than ${atLeast(certificate.bound_m)} (proved)` : touched || line ? "" : ". Not proved free of contact";
    $("verdict").textContent = `${mark} ${text}.`;
    $("verdict").className = mark === "✓" ? "good" : mark === "!" ? "doubt" : "bad";
    const {task, planner, robot, seed} = record;
    $("about").textContent = [task.name, stated.label, robot.name, `seed ${seed}`, drive.mapless ? "without a map" : ""].filter(Boolean).join(" · ");
    const near = drive.nearest(row), slow = drive.slowest(), t = drive.time(row);
    this.answer("closest", touched ? "First contact" : "Closest", `${drive.name(touched ? drive.contacts[1] : near.thing)} at ${seconds(t)}`, metres(drive.clearance[row]), t);
    if (slow) {
      const [from, to] = [drive.time(slow.from), drive.time(slow.to)];
      this.answer("slowest", "Slowest", words(slow.rule), `${from.toFixed(1)}–${seconds(to)}: ${slow.lost.toFixed(2)} m lost`, (from + to) / 2);
    } else this.answer("slowest", "Slowest", "at top speed nearly all the way", "", 0);
    const sign = (good) => (good === undefined ? "…" : good === null ? "not computed" : good ? "✓" : "✕");
    const proof = ["physics", "geometry", "bound"].map((key) => `${key} ${sign(checks?.[key])}`).join(" ");
    if (line) this.answer("proof", "Proof", "none: this is the accepted drive's line alone", "", t);
    else this.answer("proof", "Proof", proof, checks ? `digest recomputed ${sign(checks.digest)}` : "digest …", t);
    const other = this.drives.find((one) => one !== drive), apart = other && drive.parts(other);
    $("parts").hidden = apart === undefined;
    if (apart !== undefined) this.answer("parts", "Drives part", `from ${other.stated.label}`, `at ${seconds(apart)}`, apart);
    $("proof").title = `SHA-256 of the log: ${checks?.value || record.digest}`;
    $("problems").replaceChildren(...certificate.problems.map((problem) => make("li", {textContent: problem})));
    $("command").textContent = stated.command;
    const bar = $("drives");
    bar.hidden = this.drives.length < 2;
    bar.replaceChildren(...this.drives.map((one) => {
      const chip = make("i");
      chip.style.background = this.scrubber.colour(one);
      const button = make("button", {type: "button", onclick: () => this.choose(one)}, chip,
        `${one.stated.label} ${one.stated.line ? "" : one.stated.certificate.certified ? "≥ " + atLeast(one.stated.certificate.bound_m) : "not proved"}`);
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
    clearTimeout(this.later);
    if (!this.playing) this.later = setTimeout(() => this.settle(), 250);
  }

  // Put the moment into the address and into words once it rests.
  settle() {
    const hash = `#t=${this.t.toFixed(3)}&cam=${this.scene?.camera.name ?? "follow"}`;
    if (location.hash !== hash) history.replaceState(null, "", hash);
    $("words").textContent = this.sentence();
  }

  sentence() {
    const {drive} = this, row = drive.row(this.t), near = drive.nearest(row);
    return `At ${drive.time(row).toFixed(2)} seconds: ${metres(drive.clearance[row])} to ${drive.name(near.thing)}; speed ` +
      `${drive.speed(row).toFixed(2)} of ${+drive.record.robot.max_speed.toPrecision(3)} metres a second, limited by ${words(drive.rule(row))}.`;
  }

  paint() {
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => { this.asked = 0; this.frame(); });
  }

  frame() {
    const {drive, scene} = this, row = drive.row(this.t), tag = $("distance");
    let near;
    if (scene) {
      const canvas = $("scene"), ratio = scene.ratio = scene.gl.software ? 1 : Math.min(2, devicePixelRatio || 1);
      const [w, h] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
      if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
      near = scene.draw(row);
      tag.hidden = !near.at;
      if (near.at && near.from) {
        const [x, y] = near.at, dx = x - near.from[0], dy = y - near.from[1], away = Math.hypot(dx, dy) || 1;
        tag.style.transform = `translate(${(x + 46 * dx / away).toFixed(1)}px, ${(y + 24 * dy / away).toFixed(1)}px) translate(-50%, -50%)`;
      }
    } else near = drive.nearest(row);
    tag.textContent = metres(drive.clearance[row]);
    this.scrubber.draw(this.t);
    const set = (id, text) => { if ($(id).textContent !== text) $(id).textContent = text; };
    set("clock", `${drive.time(row).toFixed(2)} s`);
    set("clearance", `${metres(drive.clearance[row])} to ${drive.name(near.thing)}`);
    set("speed", `${Math.abs(drive.speed(row)).toFixed(2)} of ${+drive.record.robot.max_speed.toPrecision(3)} m/s`);
    set("rule", words(drive.rule(row)));
    $("rule").style.setProperty("--chip", ruleColour(drive, drive.limiter[row]));
    const others = this.drives.filter((one) => one !== drive);
    if (others.length) set("apart", others.map((one) => {
      const [ax, ay] = drive.at(row), [bx, by] = one.at(one.row(this.t));
      return `${Math.hypot(ax - bx, ay - by).toFixed(2)} m from ${one.stated.label}, which has ${metres(one.clearance[one.row(this.t)])} of clearance`;
    }).join(", "));
    $("apart").parentNode.hidden = !others.length;
    const slider = $("curve");
    slider.setAttribute("aria-valuenow", this.t.toFixed(2));
    slider.setAttribute("aria-valuetext", `${drive.time(row).toFixed(2)} s, clearance ${metres(drive.clearance[row])}`);
  }

  play() {
    if (this.playing) return this.pause();
    if (this.t >= this.end - 1e-6) this.t = 0;
    this.playing = true;
    $("play").textContent = "❚❚";
    $("play").setAttribute("aria-label", "Pause");
    let before = performance.now();
    const step = (now) => {
      if (!this.playing) return;
      this.t = Math.min(this.end, this.t + (now - before) / 1000 * +$("pace").value);
      before = now;
      this.frame();
      if (this.t >= this.end) this.pause();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame((now) => { before = now; requestAnimationFrame(step); });
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    $("play").textContent = "▶";
    $("play").setAttribute("aria-label", "Play");
    this.settle();
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
      const {row, least} = drive.approach(j), seen = drive.firstSeen(j), jump = (t, text) =>
        make("button", {type: "button", textContent: text, onclick: () => { this.pause(); this.seek(t); }});
      box.append(make("b", {textContent: drive.name(j)}), ` nearest ${metres(least)} `, jump(drive.time(row), `at ${seconds(drive.time(row))}`));
      if (seen !== undefined) box.append("; first seen ", seen === null ? "never" : jump(seen, `at ${seconds(seen)}`));
    }
    this.paint();
  }

  read(hash) {
    const words = new URLSearchParams(hash.slice(1)), t = words.get("t");
    this.view(CAMERAS.includes(words.get("cam")) ? words.get("cam") : "follow");
    this.seek(t !== null && Number.isFinite(+t) ? +t : this.t);
    this.asked && cancelAnimationFrame(this.asked);
    this.asked = 0;
    this.frame();
  }

  wire() {
    $("play").onclick = () => this.play();
    $("pace").replaceChildren(...SPEEDS.map((x) => make("option", {value: x, textContent: `${x}×`, selected: x === 1})));
    document.querySelectorAll("#cameras button[value]").forEach((one) => { one.onclick = () => this.view(one.value); });
    $("bodies").onchange = () => this.pick(+$("bodies").value);
    $("copy").onclick = async () => {
      await navigator.clipboard?.writeText($("command").textContent).catch(() => {});
      $("copy").textContent = "copied";
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
    const again = () => { this.scrubber.drawn = false; this.scene?.paint(); this.tell(); this.paint(); };
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
    new ResizeObserver(() => this.paint()).observe($("view"));
    new ResizeObserver(() => this.paint()).observe($("curve"));
    addEventListener("beforeprint", () => { this.scrubber.drawn = false; this.frame(); });
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
      m: () => { const {drive} = this; this.seek(drive.time(drive.closest)); },
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
