// What the pages of runs draw alike: the camera's image, the plan, and lines over time.

// The pen of a canvas that is as wide as its place, for a height [CSS px]; with its width.
function sharpPen(canvas, high) {
  const wide = canvas.clientWidth, dense = window.devicePixelRatio;
  canvas.style.height = `${high}px`;
  [canvas.width, canvas.height] = [wide * dense, high * dense];
  const pen = canvas.getContext("2d");
  pen.scale(dense, dense);
  pen.font = "12px system-ui, sans-serif";
  return [pen, wide];
}

// The camera's image with cells and flow; points of the moment are in sixteenths of an image pixel.
function drawCamera(canvas, scale, flowColor, moment, image) {
  const pen = canvas.getContext("2d");
  pen.drawImage(image, 0, 0, canvas.width, canvas.height);
  const step = scale / 16;
  for (const [color, points] of moment.cells) {
    pen.fillStyle = color;
    for (let i = 0; i < points.length; i += 2) {
      pen.fillRect(points[i] * step - 2, points[i + 1] * step - 2, 4, 4);
    }
  }
  pen.strokeStyle = flowColor;
  pen.lineWidth = 1.5;
  pen.beginPath();
  for (let i = 0; i < moment.flow.length; i += 4) {
    pen.moveTo(moment.flow[i] * step, moment.flow[i + 1] * step);
    pen.lineTo(moment.flow[i + 2] * step, moment.flow[i + 3] * step);
  }
  pen.stroke();
}

// The point [x, y] of a frame at {x, y, yaw}, in that one's parent.
function placed(frame, [x, y]) {
  const c = Math.cos(frame.yaw), s = Math.sin(frame.yaw);
  return [frame.x + c * x - s * y, frame.y + s * x + c * y];
}

// A plan of the data's shapes and places that wheel, drag and the keys + - 0 zoom and move.
// draw(path, moment): rows [x, y, leader] of the path so far; what is known at the moment.
function makePlan(canvas, data, redraw) {
  const [x0, y0, x1, y1] = data.bounds, view = {zoom: 1, x: 0.5 * (x0 + x1), y: 0.5 * (y0 + y1)};
  let scale = 1, drag = null;
  function zoom(by) {
    view.zoom = Math.min(Math.max(view.zoom * by, 1), 40);
    if (view.zoom === 1) [view.x, view.y] = [0.5 * (x0 + x1), 0.5 * (y0 + y1)];
    redraw();
  }
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const box = canvas.getBoundingClientRect(), before = view.zoom;
    const x = (event.clientX - box.left - box.width / 2) / scale, y = (box.top + box.height / 2 - event.clientY) / scale;
    zoom(Math.exp(-0.002 * event.deltaY));
    if (view.zoom > 1) [view.x, view.y] = [view.x + x * (1 - before / view.zoom), view.y + y * (1 - before / view.zoom)];
  }, {passive: false});
  canvas.addEventListener("pointerdown", (event) => { if (event.pointerType === "mouse") drag = [event.clientX, event.clientY]; });
  addEventListener("pointerup", () => { drag = null; });
  addEventListener("pointermove", (event) => {
    if (!drag) return;
    view.x -= (event.clientX - drag[0]) / scale;
    view.y += (event.clientY - drag[1]) / scale;
    drag = [event.clientX, event.clientY];
    redraw();
  });
  canvas.addEventListener("dblclick", () => zoom(0));
  canvas.addEventListener("keydown", (event) => {
    const by = {"+": 1.4, "=": 1.4, "-": 1 / 1.4, "0": 0}[event.key];
    if (by !== undefined) zoom(by);
  });

  return function draw(path, moment) {
    const high = Math.max(160, Math.min(canvas.clientWidth * (y1 - y0) / (x1 - x0), 520));
    const [pen, wide] = sharpPen(canvas, high);
    scale = view.zoom * Math.min(wide / (x1 - x0), high / (y1 - y0));
    const px = (x) => 0.5 * wide + (x - view.x) * scale, py = (y) => 0.5 * high - (y - view.y) * scale;
    function shape(of) {
      pen.fillStyle = of.fill || "transparent";
      pen.strokeStyle = of.edge || "transparent";
      pen.lineWidth = of.width || 1;
      pen.setLineDash(of.dash || []);
      const trace = new Path2D();
      for (const [x, y, r] of of.discs || []) {
        trace.moveTo(px(x) + r * scale, py(y));
        trace.arc(px(x), py(y), r * scale, 0, 7);
      }
      for (const [x, y] of of.marks || []) {
        for (let i = 0; i < 10; i++) {
          const r = i % 2 ? 4 : 9, turn = Math.PI * (i / 5 - 0.5);
          trace[i ? "lineTo" : "moveTo"](px(x) + r * Math.cos(turn), py(y) + r * Math.sin(turn));
        }
      }
      for (const [x, y] of of.area || of.line || []) trace.lineTo(px(x), py(y));
      if (of.area) trace.closePath();
      if (!of.line) pen.fill(trace);
      pen.stroke(trace);
    }
    data.shapes.forEach(shape);
    if (moment.map) { // of the robot's surroundings, in a frame that may be turned
      const {image, x, y, yaw, size} = moment.map;
      pen.save();
      pen.translate(px(x), py(y));
      pen.rotate(-yaw);
      pen.imageSmoothingEnabled = false;
      pen.drawImage(image, 0, -size[1] * scale, size[0] * scale, size[1] * scale);
      pen.restore();
    }
    for (let i = 1, from = 0; i <= path.length; i++) {
      if (i < path.length && path[i][2] === path[from][2]) continue;
      shape({line: path.slice(Math.max(from - 1, 0), i), edge: data.colors[path[from][2]] || data.colors.none, width: 4});
      from = i;
    }
    if (moment.believed) shape({line: moment.believed, edge: data.estimate, dash: [4, 3]});
    [pen.fillStyle, pen.strokeStyle, pen.lineWidth] = ["#1c2430", "#fff", 3];
    pen.setLineDash([]);
    const written = []; // of the places' names, those with room
    for (const [name, x, y] of data.places) {
      const size = pen.measureText(name).width + 6, left = Math.min(px(x) + 5, wide - size), low = py(y) - 4;
      pen.fillRect(px(x) - 2, py(y) - 2, 4, 4);
      if (written.some((w) => left < w[0] + w[2] && w[0] < left + size && Math.abs(low - w[1]) < 14)) continue;
      written.push([left, low, size]);
      pen.strokeText(name, left, low);
      pen.fillText(name, left, low);
    }
    for (const course of moment.courses || []) shape({line: course, edge: data.moving, width: 2});
    shape({discs: moment.movers || [], fill: data.moving});
    shape({discs: moment.walkers || [], edge: data.moving, width: 2});
    if (moment.way) shape({line: moment.way, edge: data.goal, width: 2, dash: [2, 4]});
    const bodies = (at) => data.discs.map(([x, y, r]) => [...placed(at, [x, y]), r]);
    if (moment.robot) {
      const nose = placed(moment.robot, [1.6 * data.discs[0][2], 0]);
      shape({discs: bodies(moment.robot), fill: "#fff", edge: "#000", width: 2});
      shape({line: [[moment.robot.x, moment.robot.y], nose], edge: "#000", width: 2});
    }
    if (moment.estimate) shape({discs: bodies(moment.estimate), edge: data.estimate, dash: [4, 3]});
    for (const [x, y, color] of moment.marks || []) shape({discs: [[x, y, 7 / scale]], edge: color, width: 3});
  };
}

// Lines over time, as wide as their place. lines: [{values, color, dash}]; time and values alike long,
// null where there is none. from, to: ends of the axis of time; now: a mark; marks: [[time, color]].
const CHART_LEFT = 52, CHART_RIGHT = 10;
function drawChart(canvas, {time, lines, label, from, to, now, marks, low, high}) {
  const [pen, wide] = sharpPen(canvas, 130), top = 20, bottom = 112;
  const shown = lines.flatMap((line) => line.values).filter((value) => value !== null);
  let least = low ?? Math.min(0, ...minmax(shown)), most = high ?? Math.max(...minmax(shown));
  if (!(most > least)) most = least + 1;
  const px = (t) => CHART_LEFT + (t - from) / (to - from || 1) * (wide - CHART_LEFT - CHART_RIGHT);
  const py = (value) => bottom - (value - least) / (most - least) * (bottom - top);
  pen.fillStyle = "#4d5765";
  pen.strokeStyle = "#d9dee5";
  pen.fillText(label, 2, 12);
  const ticks = (a, b, count) => {
    const rough = (b - a) / count, ten = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((k) => k * ten).find((s) => s >= rough), digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const result = [];
    for (let n = Math.ceil(a / step - 1e-9); n * step <= b + 1e-9 * step; n++) result.push([n * step, (n * step).toFixed(digits)]);
    return result;
  };
  pen.textAlign = "right";
  for (const [value, text] of ticks(least, most, 4)) {
    pen.fillText(text, CHART_LEFT - 6, py(value) + 4);
    pen.strokeRect(CHART_LEFT, py(value), wide - CHART_LEFT - CHART_RIGHT, 0);
  }
  pen.textAlign = "center";
  for (const [value, text] of ticks(from, to || 1, Math.max(2, wide / 110))) pen.fillText(text, px(value), bottom + 15);
  const line = (color, width, dash, trace) => {
    [pen.strokeStyle, pen.lineWidth] = [color, width];
    pen.setLineDash(dash);
    pen.beginPath();
    trace();
    pen.stroke();
  };
  for (const [at, color] of marks || []) line(color, 1, [2, 3], () => { pen.moveTo(px(at), top); pen.lineTo(px(at), bottom); });
  for (const {values, color, dash} of lines) {
    line(color, 1.6, dash || [], () => {
      let on = false;
      values.forEach((value, i) => {
        if (value !== null) pen[on ? "lineTo" : "moveTo"](px(time[i]), py(value));
        on = value !== null;
      });
    });
  }
  if (now !== undefined) line("#B0004E", 2, [], () => { pen.moveTo(px(now), top - 4); pen.lineTo(px(now), bottom); });
}

// The terms of an input over its range, points [x, degree] each; filled up to the degree at a value.
const TERM_COLORS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#A87400", "#56B4E9", "#555", "#8C564B"];
function drawTerms(canvas, {low, high, terms}, value) {
  const [pen, wide] = sharpPen(canvas, 110), top = 34, bottom = 92;
  const px = (x) => 8 + (x - low) / (high - low) * (wide - 16), py = (y) => bottom - y * (bottom - top);
  const at = Math.min(Math.max(value, low), high);
  const trace = (points) => points.forEach(([x, y], i) => pen[i ? "lineTo" : "moveTo"](px(x), py(y)));
  const names = [];
  Object.entries(terms).forEach(([name, points], n) => {
    const next = Math.max(points.findIndex(([x]) => x >= at), 1), [a, b] = [points[next - 1], points[next]];
    const degree = a[1] + (b[1] - a[1]) * (at - a[0]) / (b[0] - a[0] || 1);
    pen.fillStyle = pen.strokeStyle = TERM_COLORS[n % TERM_COLORS.length];
    pen.save();
    pen.beginPath();
    pen.rect(0, py(degree), wide, bottom - py(degree));
    pen.clip();
    pen.globalAlpha = 0.3;
    pen.beginPath();
    trace([[low, 0], ...points, [high, 0]]);
    pen.fill();
    pen.restore();
    pen.beginPath();
    trace(points);
    pen.stroke();
    const most = Math.max(...points.map((p) => p[1])), peak = points.filter((p) => p[1] > most - 1e-6).map((p) => p[0]);
    names.push({degree, text: degree > 0.005 ? `${name} ${degree.toFixed(2)}` : name, x: px((peak[0] + peak[peak.length - 1]) / 2), color: pen.fillStyle});
  });
  const written = [[], []]; // in two lines, what has a degree first
  for (const {text, x, color} of names.sort((a, b) => b.degree - a.degree)) {
    const size = pen.measureText(text).width, left = Math.min(Math.max(x - size / 2, 0), wide - size);
    const line = written.findIndex((others) => others.every(([from, to]) => left > to + 6 || left + size < from - 6));
    if (line < 0) continue;
    pen.fillStyle = color;
    pen.fillText(text, left, 12 + 14 * line);
    written[line].push([left, left + size]);
  }
  pen.fillStyle = "#4d5765";
  for (const [x, align] of [[low, "left"], [high, "right"]]) {
    pen.textAlign = align;
    pen.fillText(Number(x.toPrecision(3)), px(x), bottom + 15);
  }
  pen.fillStyle = "#B0004E";
  pen.fillRect(px(at) - 1, top - 4, 2, bottom - top + 4);
}

// Least and largest of numbers, however many.
function minmax(values) {
  let least = Infinity, most = -Infinity;
  for (const value of values) [least, most] = [Math.min(least, value), Math.max(most, value)];
  return values.length ? [least, most] : [0, 1];
}
