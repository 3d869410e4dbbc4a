// The little of WebGL2 that the scene needs: matrices, programs, meshes in buffers.
const FLAT = `#version 300 es
in vec3 a_place; in vec4 a_colour; uniform mat4 u_view; uniform float u_alpha, u_size; out vec4 v_colour;
void main() { gl_Position = u_view * vec4(a_place, 1.0); gl_PointSize = u_size; v_colour = a_colour * vec4(1, 1, 1, u_alpha); }`;
const PLAIN = `#version 300 es
precision mediump float; in vec4 v_colour; out vec4 colour; void main() { colour = v_colour; }`;
const GROUND = `#version 300 es
in vec2 a_place; uniform mat4 u_view; uniform vec4 u_bounds; out vec2 v_at;
void main() { gl_Position = u_view * vec4(a_place, 0.0, 1.0); v_at = (a_place - u_bounds.xy) / (u_bounds.zw - u_bounds.xy); }`;
const KNOWN = `#version 300 es
precision mediump float; in vec2 v_at; uniform sampler2D u_seen; uniform float u_now; uniform vec3 u_known, u_unknown; out vec4 colour;
void main() { float v = texture(u_seen, v_at).r; colour = vec4(mix(u_known, u_unknown, u_now < 0.0 ? v : float(v > u_now)), 1.0); }`;
const RIMS = {};
// Whether a processor draws in place of a graphics card: then edges stay rough.
const SOFTWARE = (() => {
  const gl = document.createElement("canvas").getContext("webgl2"), about = gl?.getExtension("WEBGL_debug_renderer_info");
  return /swiftshader|llvmpipe|software|basic render/i.test(about ? gl.getParameter(about.UNMASKED_RENDERER_WEBGL) : "");
})();

class Gl {
  constructor(canvas, most) {
    const gl = this.gl = canvas.getContext("webgl2", {antialias: !SOFTWARE, preserveDrawingBuffer: true});
    if (!gl) throw new Error("no WebGL2");
    Object.assign(this, {most, orders: {}});
    this.flat = this.program(FLAT, PLAIN);
    this.ground = this.program(GROUND, KNOWN);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.cullFace(gl.BACK);
  }
  program(vertex, fragment) {
    const {gl} = this, program = gl.createProgram(), places = {};
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    for (const [, name] of (vertex + fragment).matchAll(/\b(u_\w+)/g)) places[name] = gl.getUniformLocation(program, name);
    for (const [, name] of vertex.matchAll(/in \w+ (\w+);/g)) places[name] = gl.getAttribLocation(program, name);
    return {program, ...places};
  }
  buffer(data, buffer = this.gl.createBuffer(), kind = this.gl.ARRAY_BUFFER) {
    this.gl.bindBuffer(kind, buffer);
    this.gl.bufferData(kind, data, this.gl.DYNAMIC_DRAW);
    return buffer;
  }
  attribute(place, size, stride, offset) {
    const {gl} = this;
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, gl.FLOAT, false, 4 * stride, 4 * offset);
  }
  use(program, view) {
    this.gl.useProgram(program.program);
    this.gl.uniformMatrix4fv(program.u_view, false, view);
  }
  // Draw cylinders: 8 floats each, x, y, radius, height, red, green, blue, alpha; or only their roofs.
  bodies(view, data, roofs = false) {
    const sides = Math.max(8, 2 * Math.ceil((this.coarse ? 4 : 8) * (SOFTWARE ? this.share : 2))), n = data.length / 8, each = 3 * ((roofs ? 1 : 3) * sides - 2);
    const {gl} = this, order = this.orders[`${sides} ${roofs}`] ??= this.buffer(triangles(this.most, sides, roofs), undefined, gl.ELEMENT_ARRAY_BUFFER);
    this.gl.enable(this.gl.CULL_FACE);
    this.shapes(view, spread(data, sides, roofs), {order, count: n * each});
    this.gl.disable(this.gl.CULL_FACE);
  }
  // Draw vertices of 7 floats: x, y, z, red, green, blue, alpha. `mesh` is an array, or a buffer with a count.
  shapes(view, mesh, {mode = this.gl.TRIANGLES, alpha = 1, size = 1, order, count = mesh.count ?? mesh.length / 7} = {}) {
    if (!(count > 0)) return;
    const {gl, flat} = this;
    this.use(flat, view);
    if (mesh.buffer && mesh.count !== undefined) gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffer);
    else this.scratch = this.buffer(mesh instanceof Float32Array ? mesh : new Float32Array(mesh), this.scratch);
    this.attribute(flat.a_place, 3, 7, 0);
    this.attribute(flat.a_colour, 4, 7, 3);
    gl.uniform1f(flat.u_alpha, alpha);
    gl.uniform1f(flat.u_size, size);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, order ?? null);
    if (order) gl.drawElements(mode, count, gl.UNSIGNED_INT, 0);
    else gl.drawArrays(mode, 0, count);
  }
}

// Return the vertices of cylinders: rims below, above and of the roof; or of the roofs alone.
function spread(data, sides, roofs) {
  const rims = roofs ? 1 : 3, out = new Float32Array(data.length / 8 * 7 * rims * sides);
  const around = RIMS[sides] ??= Array.from({length: sides}, (_, k) => 2 * Math.PI * k / sides).map((a) => [Math.cos(a), Math.sin(a), 0.78 + 0.14 * Math.cos(a - 2.2)]);
  for (let i = 0, at = 0; i < data.length; i += 8)
    for (let rim = 3 - rims; rim < 3; rim++)
      for (const [c, s, shade] of around) {
        const light = rim === 2 ? 1 : shade;
        out[at++] = data[i] + data[i + 2] * c;
        out[at++] = data[i + 1] + data[i + 2] * s;
        out[at++] = rim ? data[i + 3] : 0;
        for (let k = 4; k < 7; k++) out[at++] = data[i + k] * light;
        out[at++] = data[i + 7];
      }
  return out;
}

// Return the vertices of the triangles of n cylinders, as numbers of `spread`'s.
function triangles(n, sides, roofs) {
  const out = [];
  for (let i = 0, at = 0; i < n; i++, at += (roofs ? 1 : 3) * sides) {
    for (let k = 0; k < sides && !roofs; k++) {
      const a = at + k, b = at + (k + 1) % sides;
      out.push(a, b, b + sides, a, b + sides, a + sides);
    }
    for (let k = 1, roof = roofs ? at : at + 2 * sides; k < sides - 1; k++) out.push(roof, roof + k, roof + k + 1);
  }
  return new Uint32Array(out);
}

const hex = (text) => [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16) / 255);

// Return the product of two matrices in columns.
function product(a, b) {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++)
    for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
  return out;
}

// Return the matrix of a camera that looks from an eye to a target, and its axes.
function looking(eye, target, fov, aspect, away, size) {
  const back = unit(eye.map((v, k) => v - target[k])), right = unit(cross([0, 0, 1], back)), up = cross(back, right);
  const f = 1 / Math.tan(fov / 2), far = away + 2 * size, near = Math.max(far / 2000, away - 2 * size), dot = (a) => a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2];
  const view = new Float32Array([right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
    -dot(right), -dot(up), -dot(back), 1]);
  const lens = new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0]);
  return {matrix: product(lens, view), right, up, back};
}

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const n = Math.hypot(...a) || 1; return a.map((v) => v / n); };

// Return a ribbon's triangle strip along points (x, y, z), with a colour for each.
function ribbon(points, width, colours) {
  const out = [], n = points.length;
  for (let k = 0; k < n; k++) {
    const [ax, ay] = points[Math.max(0, k - 1)], [bx, by] = points[Math.min(n - 1, k + 1)], [x, y, z] = points[k];
    const away = Math.hypot(bx - ax, by - ay) || 1, nx = -(by - ay) / away * width / 2, ny = (bx - ax) / away * width / 2;
    const colour = typeof colours[0] === "number" ? colours : colours[k];
    out.push(x + nx, y + ny, z, ...colour, x - nx, y - ny, z, ...colour);
  }
  return out;
}

// Return the triangles of a prism over a convex outline, placed at a pose.
function prism(outline, [x, y, yaw], height, colour, alpha) {
  const c = Math.cos(yaw), s = Math.sin(yaw), out = [], shade = (light) => [...colour.map((v) => v * light), alpha];
  const placed = outline.map(([px, py]) => [x + px * c - py * s, y + px * s + py * c]);
  placed.forEach(([ax, ay], k) => {
    const [bx, by] = placed[(k + 1) % placed.length], side = shade(0.72 + 0.16 * Math.cos(Math.atan2(ax - bx, by - ay) - 2.2)), top = shade(1);
    const quad = [[ax, ay, 0], [bx, by, 0], [bx, by, height], [ax, ay, 0], [bx, by, height], [ax, ay, height]];
    quad.forEach((p) => out.push(...p, ...side));
    [placed[0], [ax, ay], [bx, by]].forEach((p) => out.push(...p, height, ...top));
  });
  return out;
}
