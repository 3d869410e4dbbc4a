// The scene in three dimensions at a moment: bodies, routes, trails, scans, and the line to the nearest body.
const THEMES = {
  light: {sky: "#f4f6f9", ground: "#e6eaf0", unknown: "#f6f7fa", grid: "#cfd6e0", zone: "#d6deec", kerb: "#b9c2cf", body: "#7988a0",
    unseen: "#c44a8a", mover: "#8232e6", shell: "#e06000", route: "#182242", ink: "#1c212c", start: "#345cbe", goal: "#008a5c",
    beam: "#148cd6", hit: "#003e94", picked: "#c8102e", halo: "#ffffff", calm: "#66738c"},
  dark: {sky: "#14171d", ground: "#232833", unknown: "#191c23", grid: "#333a47", zone: "#2b3444", kerb: "#48505f", body: "#7486a6",
    unseen: "#d8609c", mover: "#a678f4", shell: "#ff8a2a", route: "#c6d0e6", ink: "#f2f4f8", start: "#7d9df0", goal: "#35c795",
    beam: "#3aa6ea", hit: "#8cc8ff", picked: "#ff6b7f", halo: "#000000", calm: "#98a4ba"},
};
const FOV = 0.6, TOP_FOV = 0.08, FADED = 0.22, CAMERAS = ["follow", "whole", "top"], TRAIL = 15;

class Scene {
  constructor(canvas, drives) {
    this.canvas = canvas;
    this.gl = new Gl(canvas);
    this.drives = drives;
    this.camera = {name: "follow", turn: 0, tilt: 0.82, zoom: 1, shift: [0, 0]};
    this.picked = -1;
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
    const {gl, drive} = this, dark = matchMedia("(prefers-color-scheme: dark)").matches, theme = THEMES[dark ? "dark" : "light"];
    this.colours = Object.fromEntries(Object.entries(theme).map(([name, value]) => [name, hex(value)]));
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
    this.routes = [{t: 0, points: pairs(drive.route)}, ...record.replans.filter((r) => r.solved).map((r) => ({t: r.t, points: r.route}))]
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
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    return this.drives.length > 1 ? hex(drive.stated.colours[dark ? 1 : 0]) : this.colours.shell;
  }

  // Upload when each piece of ground was first seen: scans at 10 Hz, from the true poses.
  know() {
    const {gl} = this.gl, {drive} = this;
    if (!drive.mapless || !drive.scans?.length) return;
    const {columns, rows, when} = drive.known ??= firstSeen(drive);
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
    const follow = camera.name === "follow", top = camera.name === "top", [x, y] = drive.at(row);
    const target = follow ? [x, y, 0] : [(x0 + x1) / 2, (y0 + y1) / 2, 0], tilt = top ? 1.5707 : camera.tilt;
    const wide = x1 - x0 >= y1 - y0 === aspect >= 1, turn = (follow ? this.facing : wide ? Math.PI / 2 : Math.PI) + camera.turn;
    const fov = top ? TOP_FOV : FOV, fit = Math.tan(fov / 2), [ax, al] = wide ? [x1 - x0, y1 - y0] : [y1 - y0, x1 - x0];
    const usual = follow ? (2.6 + 5 * drive.reach) / fit / 2 / Math.min(1, aspect) : 1.12 * Math.max(al * (top ? 1 : 0.86), ax / aspect) / fit / 2;
    const far = usual / camera.zoom, [c, s] = [Math.cos(turn), Math.sin(turn)];
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
    const robots = this.drives.filter((one) => one !== drive).map((one) => [one, 0.5]);
    this.robot(m, drive, row, 1);
    gl.depthMask(false);
    tool.bodies(m, faded);
    gl.depthMask(true);
    for (const [one, alpha] of robots) this.robot(m, one, one.row(at), alpha);
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
    gl.uniform4f(ground.u_bounds, x0, y0, x1, y1);
    gl.uniform1f(ground.u_now, (Math.floor(254 * at / Math.max(drive.end, 1e-9)) + 0.5) / 255);
    gl.uniform3f(ground.u_known, ...c.ground);
    gl.uniform3f(ground.u_unknown, ...c.unknown);
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
      (covers ? faded : solid).push(ox, oy, r, height + (known ? 0.002 * (j % 7) : -0.01), ...colour, covers ? FADED : 1);
    }
    return {solid, faded};
  }

  robot(m, drive, row, alpha) {
    const {gl: tool} = this, pose = drive.at(row), high = drive.record.robot.height, outline = drive.outline ??= outlineOf(drive.foot);
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
    const {drive, colours: c, gl: tool, gl: {gl}} = this, {lidar} = drive.record.robot;
    if (!drive.scans?.length || !lidar) return;
    let k = -1;
    while (k + 1 < drive.scan_rows.length && drive.scan_rows[k + 1] <= row) k++;
    if (k < 0) return;
    const points = scanOf(drive, k), fan = [], hits = [], eye = [points.x, points.y, 0.005, ...c.beam, 0.16];
    const each = Math.ceil(points.ends.length / 240);  // beams are many, and drawn for every frame
    points.ends.forEach(([x, y, hit], b) => {
      if (b >= each && b % each === 0)
        fan.push(...eye, ...points.ends[b - each].slice(0, 2), 0.005, ...c.beam, 0.1, x, y, 0.005, ...c.beam, 0.1);
      if (hit && b % each === 0) hits.push(x, y, 0.01, ...c.hit, 1);
    });
    tool.shapes(m, fan);
    tool.shapes(m, hits, {mode: gl.POINTS, size: 3 * (this.ratio ?? 1)});
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

const pairs = (flat) => Array.from({length: flat.length / 2}, (_, k) => [flat[2 * k], flat[2 * k + 1]]);

// Return the lidar's place and the ends of its beams (x, y, whether it hit) of a scan, from the true pose.
function scanOf(drive, k) {
  const {lidar} = drive.record.robot, [x, y, yaw] = drive.at(drive.scan_rows[k]), c = Math.cos(yaw), s = Math.sin(yaw), n = lidar.beams;
  const ex = x + lidar.x * c - lidar.y * s, ey = y + lidar.x * s + lidar.y * c, round = lidar.field_of_view > 2 * Math.PI - 1e-5;
  const spacing = lidar.field_of_view / (round ? n : Math.max(1, n - 1)), first = yaw + lidar.yaw - lidar.field_of_view / 2, ends = [];
  for (let b = 0; b < n; b++) {
    const mm = drive.scans[k * n + b], reach = mm === 0 ? lidar.max_range : mm === 1 ? 0 : mm / 1000, angle = first + b * spacing;
    ends.push([ex + reach * Math.cos(angle), ey + reach * Math.sin(angle), mm > 1]);
  }
  return {x: ex, y: ey, ends};
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
