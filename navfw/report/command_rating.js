// How the fusion rates every command, and each behaviour's part in it.

// parts (one array per behaviour), sum, and forbidden, of all commands: speeds by turns, row by row.
function rateCommands(moment, grid, fusion) {
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const desires = bytes(moment.desirability), forbids = bytes(moment.prohibition);
  const {weights, applicability, leader} = moment.command, size = grid.v.length * grid.w.length;
  const weight = grid.names.map((name) => fusion.name !== "priority" ? weights[name] || 0 : Number(name === leader));
  const parts = grid.names.map(() => new Float64Array(size));
  const sum = new Float64Array(size), forbidden = new Uint8Array(size);
  for (let i = 0; i < size; i++) {
    let worst = 0;
    grid.names.forEach((name, n) => {
      if (fusion.name !== "priority" || weight[n]) worst = Math.max(worst, forbids[n * size + i] / 255);
    });
    forbidden[i] = fusion.name !== "damn" && worst > (fusion.cut ?? 0.5);
    grid.names.forEach((name, n) => {
      const desire = desires[n * size + i] / 255, forbid = forbids[n * size + i] / 255;
      if (fusion.name === "damn") parts[n][i] = weight[n] * (desire - (fusion.against ?? 1) * forbid);
      else if (!forbidden[i]) parts[n][i] = (1 - worst) * (fusion.blend === "max" ? Math.min(applicability[name] ?? 0, desire) : weight[n] * desire);
      sum[i] = fusion.blend === "max" ? Math.max(sum[i], parts[n][i]) : sum[i] + parts[n][i];
    });
  }
  return {weight, parts, sum, forbidden};
}

const RATING_TEXTS = {
  fuzzy: "The weighted desires of all behaviours, less what any of them prohibits; crossed out where a prohibition excludes a command. Outlined is what comes near the best: the cross, the command, is the middle of one such region.",
  damn: "The weighted votes of all behaviours for and against a command, before they are smoothed. The cross, the command, has the most.",
  priority: "What the leading behaviour desires, less what it prohibits. The cross, the command, is its best.",
  "": "The weighted desires of all behaviours, less what any of them prohibits. The fusion of this run chooses by a rule of its own.",
};

// A field of commands: left turns at the left, faster upwards. color of a value; axes: with numbers.
function drawCommands(canvas, grid, values, {color, high, axes, forbidden, level, cross}) {
  const [pen, wide] = sharpPen(canvas, high), left = axes ? 44 : 0, right = axes ? 62 : 0, low = axes ? 34 : 0;
  const speeds = grid.v.length, turns = grid.w.length;
  const w = (wide - left - right) / turns, h = (high - low - (axes ? 8 : 0)) / speeds, top = axes ? 8 : 0;
  const x = (turn) => left + (turns - 1 - turn) * w, y = (speed) => top + (speeds - 1 - speed) * h;
  const near = (speed, turn) => values[speed * turns + turn] >= level;
  for (let speed = 0; speed < speeds; speed++) {
    for (let turn = 0; turn < turns; turn++) {
      const i = speed * turns + turn, l = x(turn), t = y(speed);
      pen.fillStyle = color(values[i]);
      pen.fillRect(l, t, w + 0.5, h + 0.5);
      if (forbidden && forbidden[i]) {
        pen.strokeStyle = "#b9606a";
        pen.lineWidth = 1;
        pen.beginPath();
        pen.moveTo(l + 2, t + h - 2);
        pen.lineTo(l + w - 2, t + 2);
        pen.stroke();
      }
    }
  }
  if (level > 0) {
    pen.strokeStyle = "#1c2430";
    pen.lineWidth = 1.5;
    pen.beginPath();
    const edge = (a, b, c, d) => { pen.moveTo(a, b); pen.lineTo(c, d); };
    for (let speed = 0; speed < speeds; speed++) {
      for (let turn = 0; turn < turns; turn++) {
        if (!near(speed, turn)) continue;
        const l = x(turn), t = y(speed);
        if (turn === 0 || !near(speed, turn - 1)) edge(l + w, t, l + w, t + h);
        if (turn === turns - 1 || !near(speed, turn + 1)) edge(l, t, l, t + h);
        if (speed === 0 || !near(speed - 1, turn)) edge(l, t + h, l + w, t + h);
        if (speed === speeds - 1 || !near(speed + 1, turn)) edge(l, t, l + w, t);
      }
    }
    pen.stroke();
  }
  if (cross) {
    const a = x(cross[1]) + w / 2, b = y(cross[0]) + h / 2, r = axes ? 7 : 3;
    for (const [ink, width] of [["#fff", axes ? 5 : 3], ["#B0004E", axes ? 2.5 : 1.5]]) {
      [pen.strokeStyle, pen.lineWidth] = [ink, width];
      pen.beginPath();
      for (const s of [1, -1]) { pen.moveTo(a - r, b - s * r); pen.lineTo(a + r, b + s * r); }
      pen.stroke();
    }
  }
  pen.strokeStyle = "#8b94a1";
  pen.lineWidth = 1;
  pen.strokeRect(left + 0.5, top + 0.5, turns * w - 1, speeds * h - 1);
  if (!axes) return;
  pen.fillStyle = "#4d5765";
  pen.textAlign = "right";
  for (const speed of [0, grid.v.findIndex((v) => Math.abs(v) < 1e-6), speeds - 1]) {
    if (speed >= 0) pen.fillText(grid.v[speed].toFixed(2), left - 5, y(speed) + h / 2 + 4);
  }
  pen.textAlign = "center";
  for (const turn of [0, (turns - 1) / 2, turns - 1]) pen.fillText(grid.w[turn].toFixed(1), x(turn) + w / 2, high - low + 14);
  pen.fillText("w [rad/s], left turns at the left; v [m/s] upwards", left + turns * w / 2, high - 4);
  const most = axes.most, bar = wide - right + 14;
  for (let n = 0; n < 40; n++) {
    pen.fillStyle = color(most * (39.5 - n) / 40);
    pen.fillRect(bar, top + n * speeds * h / 40, 10, speeds * h / 40 + 0.5);
  }
  pen.strokeRect(bar, top, 10, speeds * h);
  pen.fillStyle = "#4d5765";
  pen.textAlign = "left";
  for (const share of [0, 0.5, 1]) pen.fillText((share * most).toFixed(2), bar + 14, top + (1 - share) * speeds * h + (share === 1 ? 10 : 4 * share * 2));
}

// From white to a colour [r, g, b], full at most.
function shade([r, g, b], most) {
  return (value) => {
    const s = Math.min(Math.max(value / (most || 1), 0), 1), mix = (c) => Math.round(255 + (c - 255) * s);
    return `rgb(${mix(r)}, ${mix(g)}, ${mix(b)})`;
  };
}

// Where a value is among ascending ones, with its fraction.
function placeAmong(values, value) {
  const above = values.findIndex((v) => v >= value);
  if (above <= 0) return above < 0 ? values.length - 1 : 0;
  return above - (values[above] - value) / (values[above] - values[above - 1] || 1);
}

// The rating of all commands at a moment, {rated, cross, cell, blue}, drawn on a canvas, with a sentence on it.
function drawRating(canvas, sentence, moment, grid, fusion) {
  const size = grid.v.length * grid.w.length, bytes = atob(moment.desirability || "").length;
  const known = bytes === size * grid.names.length && moment.command.leader !== undefined;
  const command = known ? moment.command : {weights: {}, applicability: {}};
  const rated = rateCommands(known ? moment : {desirability: "", prohibition: "", command}, grid, fusion);
  const most = Math.max(...rated.sum.map((x) => x || 0), 0);
  const cross = known ? [placeAmong(grid.v, command.v), placeAmong(grid.w, command.w)] : null;
  const cell = cross && Math.round(cross[0]) * grid.w.length + Math.round(cross[1]);
  const blue = shade([8, 69, 148], most), kind = RATING_TEXTS[fusion.name] ? fusion.name : "";
  const level = kind === "fuzzy" ? (fusion.level ?? 0.8) * most : 0;
  drawCommands(canvas, grid, rated.sum, {color: blue, high: 250, axes: {most}, forbidden: rated.forbidden, level, cross});
  canvas.dataset.best = most.toFixed(3);
  sentence.textContent = !known ? "No command yet." : `${RATING_TEXTS[kind]} Here it is ${rated.sum[cell].toFixed(2)}, the best is ${most.toFixed(2)}.`;
  return {known, rated, cross, cell, blue};
}
