// The scene in three dimensions at a moment: bodies, routes, trails, scans, and the line to the nearest body.
const THEME = {  // on light and on dark ground
  sky: ["#f4f6f9", "#14171d"], ground: ["#e6eaf0", "#232833"], unknown: ["#f6f7fa", "#191c23"], grid: ["#cfd6e0", "#333a47"],
  zone: ["#d6deec", "#2b3444"], kerb: ["#b9c2cf", "#48505f"], body: ["#7988a0", "#7486a6"], unseen: ["#c44a8a", "#d8609c"],
  mover: ["#8232e6", "#a678f4"], shell: ["#e06000", "#ff8a2a"], route: ["#182242", "#c6d0e6"], ink: ["#1c212c", "#f2f4f8"],
  start: ["#345cbe", "#7d9df0"], goal: ["#008a5c", "#35c795"], beam: ["#148cd6", "#3aa6ea"], hit: ["#003e94", "#8cc8ff"],
  picked: ["#c8102e", "#ff6b7f"], halo: ["#ffffff", "#000000"], calm: ["#66738c", "#98a4ba"], field: ["#3f83bf", "#3f83bf"]
};
const FOV = 0.6, TOP_FOV = 0.08, FADED = 0.22, CAMERAS = ["follow", "ride", "whole", "top"], TRAIL = 15;

class Scene {
  constructor(canvas, drives) {
    Object.assign(this, {canvas, drives, picked: -1});
    this.gl = new Gl(canvas, 2 + Math.max(...drives.map((drive) => drive.things)));
    this.camera = {name: "follow", turn: 0, tilt: 0.82, zoom: 1, shift: [0, 0]};
    this.choose(drives[0]);
  }
  choose(drive) {
    this.drive = drive;
    const [x0, y0, x1, y1] = drive.bounds, {task} = drive.record;
    this.size = Math.hypot(x1 - x0, y1 - y0);
    this.facing = Math.atan2(task.goal[1] - task.start[1], task.goal[0] - task.start[0]);
    this.seen = null;
    this.paint();
  }
  // Build what stands still, in the colours of the page's theme.
  paint() {
    const {gl, drive} = this;
    this.colours = Object.fromEntries(Object.entries(THEME).map(([name, values]) => [name, hex(values[+dark()])]));
    const c = this.colours, {record} = drive, [x0, y0, x1, y1] = drive.bounds, step = this.size > 60 ? 5 : 1, grid = [];
    for (let x = Math.ceil(x0 / step) * step; x <= x1; x += step) grid.push(x, y0, 0, ...c.grid, 1, x, y1, 0, ...c.grid, 1);
    for (let y = Math.ceil(y0 / step) * step; y <= y1; y += step) grid.push(x0, y, 0, ...c.grid, 1, x1, y, 0, ...c.grid, 1);
    this.grid = this.kept(grid);
    this.floor = gl.buffer(new Float32Array([x0, y0, x1, y0, x0, y1, x1, y1]));
    const w = this.size / 250, walls = [[x0 - w, y0 - w, x1 + w, y0], [x0 - w, y1, x1 + w, y1 + w], [x0 - w, y0, x0, y1], [x1, y0, x1 + w, y1]];
    this.walls = this.kept(walls.flatMap(([a, b, d, e]) => prism([[a, b], [d, b], [d, e], [a, e]], [0, 0, 0], 0.12, c.kerb, 1)));
    const mapped = !drive.mapless && record.footprint_margin == null && record.inflate > 0;
    this.zones = mapped ? drive.discs.slice(0, drive.given).map((o) => [o.x, o.y, o.radius + record.inflate, 0, ...c.zone, 1]) : [];
    const {start, goal, goal_tolerance: room} = record.task;
    this.marks = [start[0], start[1], 0.6 * room, 0, ...c.start, 0.45, goal[0], goal[1], room, 0, ...c.goal, 0.4];
    const wide = Math.max(0.03, 0.16 * drive.reach);
    this.trails = this.drives.map((one) => this.trail(one, wide));
    this.routes = [{t: 0, points: Array.from({length: drive.route.length / 2}, (_, k) => drive.route.subarray(2 * k, 2 * k + 2))}, ...record.replans.filter((r) => r.solved).map((r) => ({t: r.t, points: r.route}))]
      .map(({t, points}) => ({t, mesh: this.kept(ribbon(points.map(([x, y]) => [x, y, 0]), wide / 3, [...c.route, 0.75]))}));
    if (drive.known) this.know();
  }
  kept(mesh) { return {buffer: this.gl.buffer(new Float32Array(mesh)), count: mesh.length / 7}; }
  // Return the driven line, in the colours of the rules, or of the planner among several drives.
  trail(drive, wide) {
    const step = Math.max(1, Math.round(drive.hz / TRAIL)), points = [], colours = [], rules = drive.stated.limiters.map((_, k) =>
      drive.record.limiters[k] === "cruise" ? this.colours.calm : hex(ruleColour(drive, k)));
    for (let row = 0; row < drive.rows; row += step) {
      const [x, y] = drive.at(row);
      points.push([x, y, 0]);
      colours.push([...(this.drives.length > 1 ? this.colourOf(drive) : rules[drive.limiter[row]] ?? [0.5, 0.5, 0.5]), 1]);
    }
    return {step, ...this.kept(ribbon(points, wide, colours))};
  }
  colourOf(drive) {
    return this.drives.length > 1 ? hex(drive.stated.colours[+dark()]) : this.colours.shell;
  }
  // Upload when each piece of ground was first seen, or the planner's field, such as pheromone.
  know() {
    const {gl} = this.gl, {drive} = this, {field} = drive.stated;
    if (field) drive.known ??= {...field, when: Uint8Array.from(field.values, (one) => 5 * (one.charCodeAt(0) - 40))};
    else if (drive.mapless && drive.scans?.length) drive.known ??= firstSeen(drive);
    else return;
    const {columns, rows, when} = drive.known;
    this.seen = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.seen);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, columns, rows, 0, gl.RED, gl.UNSIGNED_BYTE, when);
    for (const [key, value] of [["MIN_FILTER", "NEAREST"], ["MAG_FILTER", "NEAREST"], ["WRAP_S", "CLAMP_TO_EDGE"], ["WRAP_T", "CLAMP_TO_EDGE"]])
      gl.texParameteri(gl.TEXTURE_2D, gl["TEXTURE_" + key], gl[value]);
  }
  // Return the camera of a moment.
  look(row) {
    const {camera, drive, canvas} = this, aspect = canvas.width / canvas.height, [x0, y0, x1, y1] = drive.bounds;
    const ride = camera.name === "ride", follow = ride || camera.name === "follow", top = camera.name === "top", [x, y, yaw] = drive.at(row);
    const target = follow ? [x, y, 0] : [(x0 + x1) / 2, (y0 + y1) / 2, 0], tilt = top ? 1.5707 : Math.max(0.1, camera.tilt - 0.42 * ride);
    const wide = x1 - x0 >= y1 - y0 === aspect >= 1, turn = (ride ? yaw : follow ? this.facing : wide ? Math.PI / 2 : Math.PI) + camera.turn;
    const fov = top ? TOP_FOV : FOV, fit = Math.tan(fov / 2), [ax, al] = wide ? [x1 - x0, y1 - y0] : [y1 - y0, x1 - x0];
    const usual = follow ? (2.6 + 5 * drive.reach) / fit / 2 / Math.min(1, aspect) : 1.12 * Math.max(al * (top ? 1 : 0.86), ax / aspect) / fit / 2;
    const far = usual / camera.zoom * (ride ? 0.6 : 1), [c, s] = [Math.cos(turn), Math.sin(turn)];
    target[0] += c * camera.shift[1] + s * camera.shift[0];
    target[1] += s * camera.shift[1] - c * camera.shift[0];
    const eye = [target[0] - c * Math.cos(tilt) * far, target[1] - s * Math.cos(tilt) * far, far * Math.sin(tilt)];
    return {eye, target, far, fov, ...looking(eye, target, fov, aspect, far, this.size)};
  }
  // Return whether a ball on the ground may be in the picture.
  within(x, y, r) {
    const {eye, right, up, back, fov} = this.last, d = [x - eye[0], y - eye[1], -eye[2]], h = Math.tan(fov / 2);
    const along = (axis) => d[0] * axis[0] + d[1] * axis[1] + d[2] * axis[2], depth = -along(back), room = depth * h + 1.3 * r;
    return depth > -r && Math.abs(along(up)) < room && Math.abs(along(right)) < depth * h * this.canvas.width / this.canvas.height + 1.3 * r;
  }
  draw(row) {
    const {gl: {gl}, gl: tool, drive, colours: c, canvas} = this, at = drive.time(row), view = this.look(row), m = view.matrix;
    this.last = view;
    tool.coarse = canvas.height / (2 * view.far * Math.tan(view.fov / 2)) < 30;  // pixels for a metre
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(...c.sky, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.DEPTH_TEST);
    this.lay(m, at);
    tool.shapes(m, this.grid, {mode: gl.LINES});
    tool.bodies(m, this.zones.filter(([x, y, r]) => this.within(x, y, r)).flat(), true);
    tool.bodies(m, this.marks, true);
    const route = this.routes.filter((one) => one.t <= at + 1e-9).at(-1);
    tool.shapes(m, route.mesh, {mode: gl.TRIANGLE_STRIP});
    tool.shapes(m, route.mesh, {mode: gl.LINE_STRIP});  // where the ribbon is thinner than a pixel
    this.drives.forEach((one, k) => {
      const trail = this.trails[k], strip = {mode: gl.TRIANGLE_STRIP};
      if (one === drive) tool.shapes(m, trail, {...strip, alpha: 0.25});
      for (const mode of tool.coarse ? [gl.TRIANGLE_STRIP, gl.LINE_STRIP] : [gl.TRIANGLE_STRIP])
        tool.shapes(m, trail, {mode, alpha: one === drive ? 1 : 0.6, count: 2 * (1 + Math.floor(one.row(at) / trail.step))});
    });
    if (this.scans !== false) this.scan(m, row);
    gl.enable(gl.DEPTH_TEST);
    tool.shapes(m, this.walls);
    const {solid, faded} = this.standing(row, view);
    tool.bodies(m, solid);
    this.robot(m, drive, row, 1);
    gl.depthMask(false);
    tool.bodies(m, faded);
    gl.depthMask(true);
    for (const one of this.drives) if (one !== drive) this.robot(m, one, one.row(at), 0.5);
    gl.disable(gl.DEPTH_TEST);
    return this.span(m, row);
  }
  lay(m, at) {
    const {gl: {gl, ground}, gl: tool, drive, colours: c} = this, [x0, y0, x1, y1] = drive.bounds;
    if (!this.seen) {
      const corner = (x, y) => [x, y, 0, ...c.ground, 1];
      tool.shapes(m, [...corner(x0, y0), ...corner(x1, y0), ...corner(x0, y1), ...corner(x1, y1)], {mode: gl.TRIANGLE_STRIP});
      return;
    }
    tool.use(ground, m);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.floor);
    tool.attribute(ground.a_place, 2, 2, 0);
    gl.bindTexture(gl.TEXTURE_2D, this.seen);
    gl.uniform4f(ground.u_bounds, ...(drive.known.bounds ?? drive.bounds));
    gl.uniform1f(ground.u_now, drive.stated.field ? -1 : (Math.floor(254 * at / Math.max(drive.end, 1e-9)) + 0.5) / 255);
    gl.uniform3f(ground.u_known, ...c.ground);
    gl.uniform3f(ground.u_unknown, ...(drive.stated.field ? c.field : c.unknown));
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }
  // Return the cylinders of a moment: solid ones, and those that cover the robot.
  standing(row, {eye}) {
    const {drive, colours: c} = this, at = drive.time(row), [x, y] = drive.at(row), solid = [], faded = [], high = drive.record.robot.height;
    const ex = x - eye[0], ey = y - eye[1], length = Math.hypot(ex, ey) || 1;
    for (let j = 0; j < drive.things; j++) {
      const [ox, oy, r] = drive.disc(row, j), o = drive.discs[j], height = o ? o.height ?? 1 : drive.heights[j - drive.discs.length];
      if (!this.within(ox, oy, r + height)) continue;
      const known = !drive.mapless || drive.firstSeen(j) === undefined || (drive.firstSeen(j) ?? Infinity) <= at;
      const along = ((ox - eye[0]) * ex + (oy - eye[1]) * ey) / length, aside = Math.abs((ox - eye[0]) * ey - (oy - eye[1]) * ex) / length;
      // The line of sight to the robot's far lower edge passes here at this height.
      const share = Math.min(1, Math.max(0, (along - r) / length)), above = eye[2] * (1 - share);
      const covers = along < length && along > 0 && aside < r + drive.reach && above < height + 0.5 * high && length > 1e-6;
      const base = j === this.picked ? c.picked : !o ? c.mover : j >= drive.given ? c.unseen : c.body;
      const colour = known ? base : base.map((v, k) => 0.25 * v + 0.75 * c.unknown[k]);
      (covers ? faded : solid).push(ox, oy, r, height + (known ? 0.0005 * (j % 61) : -0.01), ...colour, covers ? FADED : 1);
    }
    return {solid, faded};
  }
  robot(m, drive, row, alpha) {
    const {gl: tool} = this, pose = drive.at(row), ghost = alpha < 1 && 1 + this.drives.indexOf(drive);  // each a little lower
    const high = drive.record.robot.height * (1 - 0.02 * ghost), outline = drive.outline ??= outlineOf(drive.foot);
    tool.gl.enable(tool.gl.CULL_FACE);
    tool.shapes(m, prism(outline, pose, high, this.colourOf(drive), alpha));
    tool.gl.disable(tool.gl.CULL_FACE);
    if (tool.coarse) tool.shapes(m, [pose[0], pose[1], high, ...this.colourOf(drive), alpha], {mode: tool.gl.POINTS, size: 9 * (this.ratio ?? 1)});
    const [x, y, yaw] = pose, place = (a, b) => [x + a * Math.cos(yaw) - b * Math.sin(yaw), y + a * Math.sin(yaw) + b * Math.cos(yaw), high * 1.02];
    const nose = Math.max(...outline.map((p) => p[0])), side = 0.45 * nose, white = [1, 1, 1, alpha];
    tool.shapes(m, [place(0.85 * nose, 0), place(-0.1 * nose, side), place(-0.1 * nose, -side)].flatMap((p) => [...p, ...white]));
  }
  // Draw the latest scan: its beams and hits.
  scan(m, row) {
    const {drive, colours: c, gl: tool, gl: {gl}} = this;
    if (!drive.scans?.length || !drive.record.robot.lidar) return;
    let k = -1;
    while (k + 1 < drive.scan_rows.length && drive.scan_rows[k + 1] <= row) k++;
    if (k < 0) return;
    if (this.scanned?.k !== k || this.scanned.c !== c || this.scanned.drive !== drive) {
      const points = scanOf(drive, k), hits = [], eye = [points.x, points.y, 0.005, ...c.beam, 0.16], fan = [...eye];
      const each = Math.ceil(points.ends.length / 240);  // beams are many
      points.ends.forEach(([x, y, hit], b) => {
        if (b % each) return;
        fan.push(x, y, 0.005, ...c.beam, 0.1);
        if (hit) hits.push(x, y, 0.01, ...c.hit, 1);
      });
      if (points.round) fan.push(...points.ends[0].slice(0, 2), 0.005, ...c.beam, 0.1);
      this.scanned = {k, c, drive, fan: new Float32Array(fan), hits: new Float32Array(hits)};
    }
    tool.shapes(m, this.scanned.fan, {mode: gl.TRIANGLE_FAN});
    tool.shapes(m, this.scanned.hits, {mode: gl.POINTS, size: 3 * (this.ratio ?? 1)});
  }
  // Draw the line to the nearest body over everything; return its middle in pixels of the page.
  span(m, row) {
    const {drive, colours: c, gl: tool, gl: {gl}, last} = this, {ends, away, thing} = drive.nearest(row), z = 0.6 * drive.record.robot.height;
    const points = [[ends[0], ends[1], z], [ends[2], ends[3], z]], wide = last.far * Math.tan(last.fov / 2) / 80;
    for (const [width, colour] of [[2.6 * wide, [...c.halo, 0.9]], [wide, [...c.picked, 1]]]) {
      tool.shapes(m, ribbon(points, width, colour), {mode: gl.TRIANGLE_STRIP});
      tool.shapes(m, points.flatMap((p) => [...p, ...colour]), {mode: gl.POINTS, size: (width > wide ? 8 : 5) * (this.ratio ?? 1)});
    }
    return {away, thing, from: this.pixel(points[0]), at: this.pixel(points[1])};
  }
  // Return the place of a distance's label in parts of the canvas: beyond the body, or beside a contact, within the picture.
  beside({away, thing, from, at}) {
    const {clientWidth: w, clientHeight: h} = this.canvas, touch = away < 0.005, [dx, dy] = touch ? [1, 0] : [at[0] - from[0], at[1] - from[1]];
    const apart = Math.hypot(dx, dy) || 1, [,, r] = thing < this.drive.things ? this.drive.disc(0, thing) : [0, 0, 0];
    const far = touch ? 75 : Math.min(44, 2 * r * h / (2 * this.last.far * Math.tan(this.last.fov / 2)));
    const inside = (v, most, room) => Math.max(room, Math.min(most - room, v)) / most;
    return [inside(at[0] + (far + 44) * dx / apart, w, 56), inside(at[1] + (far + 18) * dy / apart, h, 22)];
  }
  // Return the place of a point in the canvas [CSS px]; null behind the camera.
  pixel([x, y, z]) {
    const {matrix: m} = this.last, w = m[3] * x + m[7] * y + m[11] * z + m[15];
    if (w <= 0) return null;
    const px = (m[0] * x + m[4] * y + m[8] * z + m[12]) / w, py = (m[1] * x + m[5] * y + m[9] * z + m[13]) / w;
    return [(px + 1) / 2 * this.canvas.clientWidth, (1 - py) / 2 * this.canvas.clientHeight];
  }
  // Return the obstacle or mover under a place of the canvas [CSS px]; -1 for none.
  pick(px, py, row) {
    const {right, up, back, eye, fov} = this.last, h = Math.tan(fov / 2), {clientWidth: w, clientHeight: v} = this.canvas;
    const sx = (2 * px / w - 1) * h * w / v, sy = (1 - 2 * py / v) * h, ray = right.map((r, k) => r * sx + up[k] * sy - back[k]);
    let best = Infinity, found = -1;
    for (let j = 0; j < this.drive.things; j++) {
      const [ox, oy, radius] = this.drive.disc(row, j), height = this.drive.discs[j]?.height ?? 0.8, dx = eye[0] - ox, dy = eye[1] - oy;
      const a = ray[0] ** 2 + ray[1] ** 2, b = ray[0] * dx + ray[1] * dy, d = b * b - a * (dx * dx + dy * dy - radius * radius);
      const roof = (height - eye[2]) / ray[2], onRoof = Math.hypot(dx + roof * ray[0], dy + roof * ray[1]) <= radius;
      const side = d >= 0 && a > 0 ? (-b - Math.sqrt(d)) / a : NaN, z = eye[2] + side * ray[2];
      const reach = onRoof ? roof : z >= 0 && z <= height ? side : Infinity;
      if (reach > 0 && reach < best) [best, found] = [reach, j];
    }
    return found;
  }
}

// Return the lidar's place and the ends of its beams (x, y, whether it hit) of a scan, from the true pose.
function scanOf(drive, k) {
  const {lidar} = drive.record.robot, [x, y, yaw] = drive.at(drive.scan_rows[k]), c = Math.cos(yaw), s = Math.sin(yaw), n = lidar.beams;
  const ex = x + lidar.x * c - lidar.y * s, ey = y + lidar.x * s + lidar.y * c, round = lidar.field_of_view > 2 * Math.PI - 1e-5;
  const spacing = lidar.field_of_view / (round ? n : Math.max(1, n - 1)), first = yaw + lidar.yaw - lidar.field_of_view / 2, ends = [];
  for (let b = 0; b < n; b++) {
    const mm = drive.scans[k * n + b], reach = mm === 0 ? lidar.max_range : mm === 1 ? 0 : mm / 1000, angle = first + b * spacing;
    ends.push([ex + reach * Math.cos(angle), ey + reach * Math.sin(angle), mm > 1]);
  }
  return {x: ex, y: ey, ends, round};
}

// Return when each cell within the walls was first seen, in 254 parts of the drive; 255 for never.
function firstSeen(drive) {
  const [x0, y0, x1, y1] = drive.bounds, cell = Math.max(0.1, Math.sqrt((x1 - x0) * (y1 - y0) / 4e5)), {lidar} = drive.record.robot;
  const columns = Math.ceil((x1 - x0) / cell), rows = Math.ceil((y1 - y0) / cell), when = new Uint8Array(columns * rows).fill(255);
  const every = Math.max(1, Math.round(lidar.rate / 10)), count = drive.scan_rows.length;
  for (let k = 0; k < count; k += every) {
    const {x, y, ends} = scanOf(drive, k), at = Math.floor(254 * drive.scan_rows[k] / Math.max(1, drive.rows - 1));
    for (const [ex, ey] of ends) {
      const steps = Math.ceil(Math.hypot(ex - x, ey - y) / (0.7 * cell)), dx = (ex - x) / steps, dy = (ey - y) / steps;
      for (let i = 0, px = x, py = y; i < steps; i++, px += dx, py += dy) {
        if (px < x0 || px >= x1 || py < y0 || py >= y1) break;
        const place = Math.floor((py - y0) / cell) * columns + Math.floor((px - x0) / cell);
        if (when[place] > at) when[place] = at;
      }
    }
  }
  return {columns, rows, when};
}
