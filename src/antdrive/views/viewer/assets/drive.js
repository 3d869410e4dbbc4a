// One drive by its log: moments are rows, and every number that the page shows comes from a row.
const WORDS = {
  cruise: "top speed or accelerating", curvature: "a curve", route: "bends or tight places ahead",
  "yaw rate": "a turning rate not reached yet", goal: "braking for the goal", rotate: "turning on the spot",
  creep: "no clear arc ahead: creeping", braking: "stopping arc not clear: full braking", done: "standing at the goal",
  clearance: "obstacles close beside the robot", avoid: "avoiding a mover", sight: "stopping within known free ground",
};
const WALLS = ["the left wall", "the right wall", "the lower wall", "the upper wall"];
const UNHURRIED = new Set(["cruise", "goal", "done"]), PAUSE = 0.25, SAME = 1e-9;

class Drive {
  constructor(log, line) {
    Object.assign(this, log, log.arrays);
    // Only what is no log of a drive, and what `antdrive verify` refuses, may claim something in its own words.
    if (!line) for (const key of ["line", "claim", "about", "notes"]) delete this.head.stated[key];
    const {record} = this, {task} = record;
    this.hz = record.physics_hz;
    this.rows = this.t.length;
    this.end = this.t[this.rows - 1];
    this.foot = record.robot.footprint;
    if (!this.foot.corners?.length) delete this.foot.corners;
    [this.bounds, this.given] = [task.bounds, (task.obstacles ?? []).length];
    this.discs = [...(task.obstacles ?? []), ...record.unseen];
    this.radii = (task.movers ?? []).map((mover) => mover.radius);
    this.heights = (task.movers ?? []).map((mover) => mover.height ?? 1);
    this.reach = reachOf(this.foot);
    this.stated = this.head.stated;
    this.mapless = record.sensing?.map === "none";
    this.closest = this.contacts.length ? this.contacts[0] : this.clearance.indexOf(this.clearance.reduce((a, b) => Math.min(a, b)));
    this.things = this.discs.length + this.radii.length;
  }
  row(t) { return Math.max(0, Math.min(this.rows - 1, Math.round(t * this.hz))); }
  time(row) { return this.t[Math.min(row, this.rows - 1)]; }
  at(row) { return this.pose.subarray(3 * row, 3 * row + 3); }
  speed(row) { return this.twist[2 * row]; }
  rule(row) { return this.record.limiters[this.limiter[row]] ?? "none"; }
  mover(row, m) { return this.movers.subarray(2 * (row * this.radii.length + m), 2 * (row * this.radii.length + m) + 2); }
  name(j) {
    const mover = j - this.discs.length;
    return mover < 0 ? `obstacle ${j}${j < this.given ? "" : " (placed after planning)"}` : mover < this.radii.length ? `mover ${mover}` : WALLS[mover - this.radii.length];
  }
  // Return x, y and radius [m] of an obstacle or mover.
  disc(row, j) {
    const o = this.discs[j];
    return o ? [o.x, o.y, o.radius] : [...this.mover(row, j - this.discs.length), this.radii[j - this.discs.length]];
  }
  // Return the nearest body, its distance [m], and the ends of the line between.
  nearest(row) {
    const [x, y, yaw] = this.at(row), walls = toWalls(this.foot, x, y, yaw, this.bounds);
    let best = [Infinity, 0];
    walls.forEach((wall, k) => { if (wall[0] < best[0]) best = [wall[0], this.things + k]; });
    for (let j = 0; j < this.things; j++) {
      const [ox, oy, r] = this.disc(row, j), room = best[0] + this.reach + r, dx = ox - x, dy = oy - y;
      if (room > 0 && dx * dx + dy * dy > room * room) continue;
      const away = toDisc(this.foot, x, y, yaw, ox, oy, r);
      if (away < best[0]) best = [away, j];
    }
    const [away, thing] = best, ends = [];
    if (thing < this.things) toDisc(this.foot, x, y, yaw, ...this.disc(row, thing), ends);
    else ends.push(...walls[thing - this.things].slice(1));
    return {thing, away, ends};
  }
  // Return the row and distance [m] of the nearest approach to an obstacle or mover.
  approach(j) {
    let row = 0, least = Infinity;
    for (let k = 0; k < this.rows; k++) {
      const away = toDisc(this.foot, ...this.at(k), ...this.disc(k, j));
      if (away < least) [row, least] = [k, away];
    }
    return {row, least};
  }
  // Return the distance [m] to another drive at a row.
  apart(row, other) {
    const [ax, ay] = this.at(row), [bx, by] = other.at(other.row(this.time(row)));
    return Math.hypot(ax - bx, ay - by);
  }
  // Return the time [s] at which another drive is first more than 1 cm away; undefined if it never is.
  parts(other) {
    for (let row = 0; row < this.rows; row++) if (this.apart(row, other) > 0.01) return this.time(row);
  }
  // Return the time [s] from and to which one rule limits the speed around a row.
  span(row) {
    let from = row, to = row;
    while (from && this.limiter[from - 1] === this.limiter[row]) from--;
    while (to < this.rows - 1 && this.limiter[to + 1] === this.limiter[row]) to++;
    return [this.time(from), this.time(to)];
  }
  // Return the time [s] at which the lidar first hit an obstacle or mover; null if never, undefined without scans.
  firstSeen(j) { return this.stated.seen?.[j]; }
  // Return the stretch of one rule in which the robot lost most distance against its top speed; null if it lost none.
  slowest() {
    const open = {}, top = this.record.robot.max_speed;
    let best = null;
    for (let row = 0; row < this.rows; row++) {
      const rule = this.rule(row);
      if (UNHURRIED.has(rule)) continue;
      if (!open[rule] || row - open[rule].to > PAUSE * this.hz) open[rule] = {rule, from: row, to: row, lost: 0};
      open[rule].to = row;
      open[rule].lost += (top - Math.abs(this.speed(row))) / this.hz;
      if (!best || open[rule].lost > best.lost) best = open[rule];
    }
    return best && best.lost > 0.05 ? best : null;
  }
  // Recompute clearance and bound of every row, in slices that leave the page free. Return both and the largest error.
  async recheck() {
    let least = Infinity, bound = Infinity, error = 0, before = null, since = performance.now();
    for (let row = 0; row < this.rows; row++) {
      const [x, y, yaw] = this.at(row), moving = this.radii.map((r, m) => toDisc(this.foot, x, y, yaw, ...this.mover(row, m), r));
      const {away} = this.nearest(row);
      const travel = before === null ? 0 : this.travel(row), limit = before && this.between(row, before, away, moving, travel);
      if (before) bound = Math.min(bound, limit);
      least = Math.min(least, away);
      error = Math.max(error, Math.abs(away - this.clearance[row]));
      before = {away, moving};
      if (row % 64 === 0 && performance.now() - since > 12) {
        await new Promise((done) => setTimeout(done));
        since = performance.now();
      }
    }
    return {least, bound: this.rows > 1 ? bound : least, error};
  }
  between(row, before, away, moving, travel) {
    let bound = (before.away + away - travel) / 2;
    moving.forEach((now, m) => {
      const step = this.step(row, m), usual = Math.min(step, this.step(row - 1, m), this.step(row + 1, m));
      const jumps = step > 0.05 && step > 3 * usual, both = travel + (jumps ? usual : step);
      bound = Math.min(bound, jumps ? Math.min(before.moving[m], now) - both : (before.moving[m] + now - both) / 2);
    });
    return bound;
  }
  step(row, m) {
    if (row < 1 || row >= this.rows) return Infinity;
    const [ax, ay] = this.mover(row - 1, m), [bx, by] = this.mover(row, m);
    return Math.hypot(bx - ax, by - ay);
  }
  // Return how far a point of the footprint moves at most in the step to a row [m].
  travel(row) {
    const [ax, ay, aw] = this.at(row - 1), [bx, by, bw] = this.at(row), dt = 1 / this.hz, {twist} = this;
    const speed = (k) => Math.max(Math.abs(twist[2 * row - 2 + k]), Math.abs(twist[2 * row + k]));
    return Math.max(Math.hypot(bx - ax, by - ay), speed(0) * dt) + this.reach * Math.max(Math.abs(wrapped(bw - aw)), speed(1) * dt);
  }
  // Check the log: contacts, distances, bound and digest.
  async check() {
    const {certificate} = this.stated, {least, bound, error} = await this.recheck(), digest = await digestOf(this);
    const close = this.radii.length ? certificate.bound_m <= bound + SAME : Math.abs(certificate.bound_m - bound) < SAME;
    return {
      physics: !this.contacts.length && !this.record.physics,
      geometry: least > 0 && error < SAME && Math.abs(least - certificate.min_clearance_m) < SAME,
      bound: bound > 0 && certificate.bound_m > 0 && close,
      digest: digest ? digest === this.record.digest && digest === this.stated.digest : null,
      value: digest,
    };
  }
}

const seconds = (t) => `${t.toFixed(1)} s`;
const metres = (d) => `${d.toFixed(3)} m`;
// Return a clearance in words; an overlap is no clearance.
const gap = (d) => (d < 0 ? `${(-1000 * d).toFixed(2)} mm overlap` : metres(d));
const words = (rule) => WORDS[rule] ?? rule;
const ended = (key) => (key === "succeeded" ? "Reached the goal" : (key[0].toUpperCase() + key.slice(1)).replaceAll("_", " "));
// Return a proved distance, rounded down.
const atLeast = (d) => metres(Math.floor(d * 1000 + 1e-9) / 1000);
// Return the colour of a rule that shows on the page's ground.
function ruleColour(drive, k) {
  const colour = drive.stated.limiters[k] ?? "#888888", faint = parseInt(colour.slice(3, 5), 16) < 48;
  return faint && dark() ? "#f2f4f8" : colour;
}
// Return whether the page is dark; on paper it never is.
const dark = () => matchMedia("(prefers-color-scheme: dark)").matches && !document.documentElement.dataset.paper;
