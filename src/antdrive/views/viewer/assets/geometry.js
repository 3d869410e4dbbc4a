// Closed-form distances between a footprint and discs or walls, as antdrive's certificate computes them.

// Return the distance [m] from a footprint at a pose to a disc, and the ends of the shortest line between them.
function toDisc(foot, x, y, yaw, ox, oy, radius, ends) {
  const c = Math.cos(yaw), s = Math.sin(yaw), dx = ox - x, dy = oy - y, bx = dx * c + dy * s, by = dy * c - dx * s;
  let apart, px, py;
  if (foot.corners) [apart, px, py] = toPolygon(foot.corners, bx, by);
  else {
    const ahead = Math.abs(bx) - foot.half_length, aside = Math.abs(by) - foot.half_width;
    const out = Math.max(ahead, 0), off = Math.max(aside, 0);
    apart = Math.sqrt(out * out + off * off) + Math.min(Math.max(ahead, aside), 0);
    px = Math.max(-foot.half_length, Math.min(foot.half_length, bx));
    py = Math.max(-foot.half_width, Math.min(foot.half_width, by));
  }
  if (ends) {
    const away = Math.hypot(bx - px, by - py) || 1, ux = (bx - px) / away, uy = (by - py) / away;
    const ax = px + foot.rounding * ux, ay = py + foot.rounding * uy, zx = bx - radius * ux, zy = by - radius * uy;
    ends.push(x + ax * c - ay * s, y + ax * s + ay * c, x + zx * c - zy * s, y + zx * s + zy * c);
  }
  return apart - foot.rounding - radius;
}

// Return the distance from a convex polygon to a point, negative within it, and the polygon's nearest point.
function toPolygon(corners, x, y) {
  if (corners.length === 1) return [Math.hypot(x - corners[0][0], y - corners[0][1]), ...corners[0]];
  let best = [Infinity, 0, 0], depth = Infinity;
  corners.forEach(([ax, ay], k) => {
    const [bx, by] = corners[(k + 1) % corners.length], length = Math.hypot(bx - ax, by - ay);
    const ex = (bx - ax) / length, ey = (by - ay) / length, vx = x - ax, vy = y - ay;
    const along = Math.max(0, Math.min(length, vx * ex + vy * ey)), px = ax + along * ex, py = ay + along * ey;
    const away = Math.hypot(x - px, y - py);
    if (away < best[0]) best = [away, px, py];
    depth = Math.min(depth, ex * vy - ey * vx);
  });
  return depth >= 0 ? [-depth, x, y] : best;
}

// Return the distances [m] from a footprint at a pose to the left, right, lower and upper wall, and its extreme points.
function toWalls(foot, x, y, yaw, [xmin, ymin, xmax, ymax]) {
  const c = Math.cos(yaw), s = Math.sin(yaw), {half_length: a, half_width: b, rounding: r} = foot;
  const corners = foot.corners ?? [[a, b], [-a, b], [-a, -b], [a, -b]];
  const placed = corners.map(([px, py]) => [x + px * c - py * s, y + px * s + py * c]);
  const most = (value) => placed.reduce((best, p) => (value(p) > value(best) ? p : best));
  const left = most((p) => -p[0]), right = most((p) => p[0]), low = most((p) => -p[1]), high = most((p) => p[1]);
  return [[left[0] - r - xmin, left[0] - r, left[1], xmin, left[1]], [xmax - right[0] - r, right[0] + r, right[1], xmax, right[1]],
    [low[1] - r - ymin, low[0], low[1] - r, low[0], ymin], [ymax - high[1] - r, high[0], high[1] + r, high[0], ymax]];
}

// Return the radius [m] of the smallest disc around a footprint, centred on the axle.
function reachOf(foot) {
  if (!foot.corners) return Math.hypot(foot.half_length, foot.half_width) + foot.rounding;
  return Math.max(...foot.corners.map(([x, y]) => Math.hypot(x, y))) + foot.rounding;
}

// Return the footprint's outline as a convex polygon [m], counter-clockwise.
function outlineOf(foot) {
  const {half_length: a, half_width: b, rounding: r} = foot, corners = foot.corners ?? [[a, b], [-a, b], [-a, -b], [a, -b]];
  if (!r) return corners;
  const around = [], steps = 48;
  for (let k = 0; k < steps; k++) {
    const angle = 2 * Math.PI * k / steps, ux = Math.cos(angle), uy = Math.sin(angle);
    const far = corners.reduce((best, p) => (p[0] * ux + p[1] * uy > best[0] * ux + best[1] * uy ? p : best));
    around.push([far[0] + r * ux, far[1] + r * uy]);
  }
  return around;
}

const wrapped = (angle) => angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
