// The clearance over time as the scrubber: bound, margin, rules, replans, contacts, and the closest moment.
const PAD = {left: 44, right: 14, top: 16, strip: 14, bottom: 18};

class Scrubber {
  constructor(canvas, drives, seek) {
    this.canvas = canvas;
    this.drives = drives;
    this.cursor = make("div", {id: "cursor"}, ...drives.map(() => make("i")));
    canvas.after(this.cursor);
    this.end = Math.max(...drives.map((drive) => drive.end), 1e-9);
    const move = (event) => seek(this.timeAt(event.offsetX));
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); move(event); });
    canvas.addEventListener("pointermove", (event) => { if (event.buttons) move(event); });
    const least = Math.min(...drives.map((drive) => drive.clearance[drive.closest])), most = Math.max(...drives.map((drive) =>
      drive.clearance.reduce((a, b) => Math.max(a, b))));
    this.high = Math.max(0.1, Math.min(most * 1.05, Math.max(5 * least, 0.6)));
  }
  choose(drive) { this.drive = drive; this.drawn = false; }
  x(t) { return PAD.left + t / this.end * (this.width - PAD.left - PAD.right); }
  timeAt(x) { return Math.max(0, Math.min(this.end, (x - PAD.left) / (this.width - PAD.left - PAD.right) * this.end)); }
  y(d) {
    const low = this.height - PAD.bottom - PAD.strip - 4;
    return low - Math.max(-0.05, Math.min(2, d / this.high)) * (low - PAD.top);
  }
  // Draw the chart where it changed, and move the cursor to a time.
  draw(t) {
    const {canvas} = this, ratio = devicePixelRatio || 1;
    if (!this.drawn || this.width !== canvas.clientWidth || this.height !== canvas.clientHeight || this.ratio !== ratio) {
      [this.width, this.height, this.ratio, this.drawn] = [canvas.clientWidth, canvas.clientHeight, ratio, true];
      canvas.width = Math.round(this.width * ratio);
      canvas.height = Math.round(this.height * ratio);
      const g = canvas.getContext("2d");
      g.setTransform(ratio, 0, 0, ratio, 0, 0);
      this.chart(g);
    }
    this.cursor.style.left = `${(this.x(t) / this.width * 100).toFixed(3)}%`;
    this.drives.forEach((drive, k) => {
      const dot = this.cursor.children[k];
      const high = this.y(Math.min(this.high, drive.clearance[drive.row(t)])) / this.height;
      Object.assign(dot.style, {background: this.colour(drive), top: `${(100 * high).toFixed(2)}%`, zIndex: +(drive === this.drive)});
    });
  }
  colour(drive) {
    return this.drives.length > 1 ? drive.stated.colours[+dark()] : this.accent;
  }
  chart(g) {
    const style = getComputedStyle(document.documentElement), get = (name) => style.getPropertyValue(name).trim(), {drive} = this;
    [this.ink, this.paper, this.accent] = [get("--ink"), get("--paper"), get("--accent")];
    const soft = get("--soft"), faint = get("--line"), low = this.y(0), right = this.width - PAD.right;
    g.clearRect(0, 0, this.width, this.height);
    g.font = "12px system-ui, sans-serif";
    g.lineWidth = 1;
    const step = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10].find((one) => this.high / one <= 4) ?? 20;
    for (let d = 0; d <= this.high + 1e-9; d += step) {
      g.strokeStyle = faint;
      line(g, PAD.left, this.y(d), right, this.y(d));
      label(g, `${+d.toFixed(2)} m`, PAD.left - 6, this.y(d) + 4, soft, "right");
    }
    const apart = [0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800].find((one) => this.end / one <= (this.width < 600 ? 5 : 12)) ?? 3600;
    for (let t = 0; t <= this.end + 1e-9; t += apart) label(g, `${+t.toFixed(1)} s`, this.x(t), this.height - 4, soft, t ? "center" : "left");
    const {certificate} = drive.stated, bound = certificate.bound_m;
    if (certificate.certified && bound > 0) {
      g.fillStyle = get("--proved");
      g.fillRect(PAD.left, this.y(bound), right - PAD.left, low - this.y(bound));
    }
    const strip = low + 4;
    for (let row = 0, from = 0; drive.record.limiters.length && row <= drive.rows; row++)
      if (row === drive.rows || drive.limiter[row] !== drive.limiter[from]) {
        g.fillStyle = ruleColour(drive, drive.limiter[from]);
        g.fillRect(this.x(drive.time(from)), strip, Math.max(0.6, this.x(drive.time(row)) - this.x(drive.time(from))), PAD.strip);
        from = row;
      }
    const margin = drive.record.footprint_margin ?? drive.record.margin;
    g.strokeStyle = soft;
    g.setLineDash([5, 4]);
    line(g, PAD.left, this.y(margin), right, this.y(margin));
    g.setLineDash([]);
    g.save();
    g.beginPath();
    g.rect(PAD.left, PAD.top, right - PAD.left, low - PAD.top + 8);
    g.clip();
    for (const one of [...this.drives.filter((other) => other !== drive), drive]) this.curve(g, one);
    g.restore();
    for (const {t} of drive.record.replans) mark(g, this.x(t), strip, this.ink);
    g.strokeStyle = this.ink;
    for (const seen of new Set(drive.stated.seen)) if (seen) line(g, this.x(seen), strip + PAD.strip - 5, this.x(seen), strip + PAD.strip);
    for (let k = 0, before = -9; k < drive.contacts.length; k += 4) {
      const row = drive.contacts[k], x = this.x(drive.time(row));
      if (row > before + drive.hz / 10) cross2(g, x, low, get("--bad"));
      g.fillStyle = get("--bad");
      g.fillRect(x - 0.5, low - 2, 2, 4);
      before = row;
    }
    if (certificate.certified && bound > 0)
      label(g, this.width < 600 ? "proved" : `proved${drive.stated.claim ? ", as assumed" : ""}: never closer than ${atLeast(bound)}`, right - 4, this.y(bound) - 4, get("--good"), "right", this.paper);
    if (margin > 0 && this.y(margin) < low - 3) label(g, `margin ${metres(margin)}`, PAD.left + 4, this.y(margin) - 3, soft, "left", this.paper);
    const t = drive.time(drive.closest), x = this.x(t), y = this.y(drive.clearance[drive.closest]), text = `${drive.contacts.length ? "first contact" : "closest " + gap(drive.clearance[drive.closest])} at ${seconds(t)}`;
    dot(g, x, y, 4, get("--bad"), this.paper);
    label(g, text, Math.max(PAD.left + 70, Math.min(right - 70, x)), PAD.top - 4, this.ink, "center");
  }
  curve(g, drive) {
    g.strokeStyle = this.colour(drive);
    g.lineWidth = drive === this.drive ? 2 : 1.3;
    g.beginPath();
    const each = Math.max(1, Math.floor(drive.rows / (4 * this.width)));
    for (let row = 0; row < drive.rows; row += each) {
      let least = Infinity;
      for (let k = row; k < Math.min(drive.rows, row + each); k++) least = Math.min(least, drive.clearance[k]);
      g.lineTo(this.x(drive.time(row)), this.y(least));
    }
    g.stroke();
  }
}

function line(g, ax, ay, bx, by) { g.beginPath(); g.moveTo(ax, ay); g.lineTo(bx, by); g.stroke(); }
function dot(g, x, y, r, fill, rim) {
  g.beginPath(); g.arc(x, y, r, 0, 7); g.fillStyle = fill; g.fill(); g.lineWidth = 1.5; g.strokeStyle = rim; g.stroke();
}
function label(g, text, x, y, fill, align, halo) {
  g.textAlign = align;
  if (halo) { g.strokeStyle = halo; g.lineWidth = 4; g.lineJoin = "round"; g.strokeText(text, x, y); }
  g.fillStyle = fill; g.fillText(text, x, y);
}
function mark(g, x, y, fill) {
  g.fillStyle = fill; g.beginPath(); g.moveTo(x, y); g.lineTo(x - 4, y - 7); g.lineTo(x + 4, y - 7); g.fill();
}
function cross2(g, x, y, stroke) {
  g.strokeStyle = stroke; g.lineWidth = 2.5; line(g, x - 5, y - 5, x + 5, y + 5); line(g, x - 5, y + 5, x + 5, y - 5);
}
