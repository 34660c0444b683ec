// The page for rules: the text of the file is all that it changes; the server says what it means.
"use strict";
(function () {
  const part = (id) => document.getElementById(id), area = part("text");
  const COLORS = ["#0072B2", "#B45000", "#00795A", "#A0488A", "#6B5D00", "#3D6FA5", "#8C3B3B"];
  const NOW = "#B0004E", HIGH = 136, TOP = 34, BOTTOM = 112, SIDE = 12;
  let file = {text: ""}, run = {}, run_known = false, drawable = true; // the file as it was read
  let number = 0, waiting = false, due = false, asked = ""; // what the server was asked last
  let answered = {text: null, view: null}, moment = null, shown = -1, wanted = 0;
  let hand = {}, surface = {}, marks = null, next = "", edit = null, last = "", was = "", line = null;
  const history = [];

  // --- asking the server -------------------------------------------------------------------------

  const socket = new WebSocket(`ws://${location.host}/${location.search}`, ["navfw.rules.v1"]);
  const send = (message) => socket.send(JSON.stringify(message));

  function ask() { // the newest text, once the last answer has come
    if (waiting) { due = true; return; }
    [waiting, due, asked] = [true, false, area.value];
    const time = run_known ? wanted : 0;
    send({op: "look", number: ++number, text: asked, values: hand, surface, time, shown});
  }

  const take = {
    file(message) {
      [file, run, run_known] = [message, message.run, Boolean(message.run.times)];
      area.value = was = message.text;
      for (const id of ["of-run", "slider", "drive"]) part(id).hidden = !run_known;
      if (run_known) {
        part("slider").max = run.times.length - 1;
        const link = location.hash.match(/^#t=([\d.]+)$/);
        wanted = link ? Number(link[1]) : run.times[0];
      }
      showOthers();
      ask();
    },
    view(message) {
      waiting = false;
      part("problem").textContent = message.problem;
      part("problem").hidden = !message.problem;
      part("note").textContent = message.note || file.unsaved;
      underline(message.lines);
      if (message.moment) {
        moment = message.moment;
        shown = moment.index;
        if (moment.picture) part("camera").src = moment.picture;
        if (marks && marks.text !== asked) marks = null;
      }
      drawable = Boolean(message.view);
      if (drawable) {
        answered = {text: asked, view: message.view};
        draw();
      } else if (run_known) showCommands();
      document.body.dataset.answered = number;
      for (const handle of document.querySelectorAll(".handle")) handle.setAttribute("aria-disabled", !drawable);
      showState();
      if (due) ask();
    },
    marks(message) {
      if (message.number !== number) return;
      marks = {...message, text: asked};
      showCommands();
    },
    saved(message) {
      file = {...file, name: message.name, text: message.text};
      part("refused").hidden = true;
      part("note").textContent = message.message;
      showState();
      if (next) begin(next);
    },
    refused(message) {
      next = "";
      part("refused").hidden = false;
      part("why").textContent = message.message;
      part("difference").textContent = message.difference || "";
      part("difference").hidden = part("load").hidden = !message.difference;
      part("load").onclick = () => {
        file.text = message.now;
        part("refused").hidden = true;
        setText(message.now, "load");
      };
      part("refused").scrollIntoView({block: "nearest"});
    },
    line(message) {
      part("printed").textContent += `${message.text}\n`;
      part("printed").scrollTop = part("printed").scrollHeight;
    },
    done(message) {
      next = "";
      part("done").textContent = message.message || "";
      part("test").textContent = "Test";
      part("drive").textContent = "Drive";
      const table = part("compared");
      for (const row of message.rows ? [["", "old run", "new run"], ...message.rows] : []) {
        const line = table.insertRow();
        for (const cell of row) line.insertCell().textContent = typeof cell === "number" ? Number(cell.toFixed(2)) : cell ?? "";
      }
      (message.reports || []).forEach((path, n) => {
        const cell = n ? line.insertCell() : (line = table.insertRow(), line.insertCell(), line.insertCell());
        const link = cell.appendChild(document.createElement("a"));
        [link.href, link.target, link.textContent] = [path + location.search, "_blank", "report"];
      });
    },
  };
  socket.onmessage = (event) => { const message = JSON.parse(event.data); take[message.op](message); };
  socket.onclose = (event) => {
    part("state").textContent = `the connection is lost: ${event.reason || "start navfw rules again; what is not saved is only here"}`;
    part("state").className = "bad";
    for (const id of ["save", "test", "drive"]) part(id).disabled = true;
  };

  function showState() {
    const wrong = !part("problem").hidden, changed = area.value !== file.text;
    part("state").className = wrong ? "bad" : changed ? "" : "good";
    const refused = `refused as it stands${drawable || !answered.view ? "" : "; drawn is the last valid state"}`;
    part("state").textContent = `${file.name}: ${wrong ? refused : changed ? "changed, not saved" : "as in the file"}`;
    part("save").disabled = wrong || !changed || Boolean(file.unsaved);
    part("test").disabled = part("drive").disabled = wrong;
    part("undo").disabled = !history.length;
  }

  // --- the text ----------------------------------------------------------------------------------

  function setText(text, key) { // key: what is edited; an undo goes back to before it
    if (key !== last) history.push(was);
    last = key;
    area.value = was = text;
    underline([]);
    ask();
  }

  // Put a value at a span of the text that was answered last; further values go to the same place.
  function change(key, span, value) {
    if (area.value === answered.text) edit = {key, base: area.value, span};
    if (edit && edit.key === key) setText(edit.base.slice(0, edit.span[0]) + value + edit.base.slice(edit.span[1]), key);
  }

  function underline(lines) {
    const under = part("under"), wrong = new Set(lines);
    under.replaceChildren();
    area.value.split("\n").forEach((text, n) => {
      const begin = text.length - text.trimStart().length;
      const marked = document.createElement(wrong.has(n + 1) ? "mark" : "span");
      marked.textContent = text.slice(begin) || " ";
      under.append(text.slice(0, begin), marked, "\n");
    });
    under.append("\n");
    follow();
  }
  const follow = () => { [part("under").scrollTop, part("under").scrollLeft] = [area.scrollTop, area.scrollLeft]; };
  area.onscroll = follow;
  area.oninput = () => setText(area.value, "typed");

  function select([begin, end]) {
    area.focus();
    area.setSelectionRange(begin, end);
    const high = parseFloat(getComputedStyle(area).lineHeight);
    area.scrollTop = high * (area.value.slice(0, begin).split("\n").length - 6);
    area.scrollLeft = 0;
  }

  // --- curves ------------------------------------------------------------------------------------

  function svg(parent, kind, attributes, text) {
    const element = parent.appendChild(document.createElementNS("http://www.w3.org/2000/svg", kind));
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    if (text !== undefined) element.textContent = text;
    return element;
  }

  const SPOTS = { // of the numbers of a shape: [x, height]
    triangle: (v) => [[v[0], 0], [v[1], 1], [v[2], 0]],
    trapezoid: (v) => [[v[0], 0], [v[1], 1], [v[2], 1], [v[3], 0]],
    gauss: ([mean, sigma]) => [[mean, 1], [mean + sigma, 0.607]],
    sigmoid: ([centre, slope]) => [[centre, 0.5], [centre + 2 / slope, 0.881]],
  };
  const NAMES = {triangle: "abc", trapezoid: "abcd", gauss: ["mean", "sigma"], sigmoid: ["centre", "slope"]};

  function numberAt(term, index, x) { // the number of a shape when its handle is at x
    const values = numbers(term);
    if (term.kind === "gauss") return index ? Math.max(Math.abs(x - values[0]), 1e-6) : x;
    if (term.kind === "sigmoid") return index ? 2 / (x - values[0] || 1e-6) : x;
    const [least, most] = [values[index - 1], values[index + 1]]; // not a number: none, or of an alias
    return Math.min(Math.max(x, Number.isFinite(least) ? least : -Infinity), Number.isFinite(most) ? most : Infinity);
  }
  const numbers = (term) => term.numbers.map(([begin, end]) => Number(answered.text.slice(begin, end)));
  const rounded = (x, width) => Number(x.toFixed(Math.min(Math.max(3 - Math.ceil(Math.log10(width)), 0), 12)));

  const panels = new Map();
  let structure = "";

  function panelOf(section, one) { // the drawing of a variable, which stays while its names do
    const key = `${section}.${one.name}`;
    if (panels.has(key)) return panels.get(key);
    const box = part(section).appendChild(document.createElement("div"));
    box.className = "variable";
    const title = box.appendChild(document.createElement("h3"));
    title.append(one.name, " ");
    const unit = title.appendChild(document.createElement("span"));
    const picture = svg(box, "svg", {role: "group", "aria-label": `${one.name}: its terms`});
    const panel = {box, unit, picture, curves: svg(picture, "g", {}), handles: [], one};
    panels.set(key, panel);
    if (section === "inputs") {
      panel.slider = box.appendChild(document.createElement("input"));
      Object.assign(panel.slider, {type: "range", step: "any", ariaLabel: `value of ${one.name}`});
      panel.slider.oninput = () => { hand[one.name] = Number(panel.slider.value); ask(); };
      panel.slider.onkeydown = (event) => { // the browser's own step would be too small
        const by = {ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1}[event.key];
        if (!by) return;
        event.preventDefault();
        panel.slider.value = Number(panel.slider.value) + by * (event.shiftKey ? 0.1 : 0.01) * (panel.one.high - panel.one.low);
        panel.slider.oninput();
      };
    }
    one.terms.forEach((term, t) => term.numbers.forEach((_, n) => addHandle(panel, key, t, n)));
    return panel;
  }

  function addHandle(panel, key, t, n) {
    const name = panel.one.terms[t].name, id = `${key}.${name}.${n}`;
    const handle = svg(panel.picture, "circle", {r: 6, class: "handle", tabindex: 0, role: "slider", "data-key": id, stroke: COLORS[t % COLORS.length]});
    const move = (x) => {
      const term = panel.one.terms[t], [low, high] = panel.one.axis;
      change(id, term.numbers[n], String(rounded(numberAt(term, n, x), high - low)));
    };
    handle.onkeydown = (event) => {
      const by = {ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1}[event.key];
      if (!by) return;
      event.preventDefault();
      const {low, high, terms} = panel.one;
      move(SPOTS[terms[t].kind](numbers(terms[t]))[n][0] + by * (event.shiftKey ? 0.1 : 0.01) * (high - low));
    };
    handle.onpointerdown = (event) => { handle.setPointerCapture(event.pointerId); handle.focus(); event.preventDefault(); };
    handle.onpointermove = (event) => {
      if (!handle.hasPointerCapture(event.pointerId)) return;
      const box = panel.picture.getBoundingClientRect(), [low, high] = panel.one.axis;
      move(low + (event.clientX - box.left - SIDE) / (box.width - 2 * SIDE) * (high - low));
    };
    panel.handles.push({handle, t, n});
  }

  function drawVariable(section, one) {
    const panel = panelOf(section, one), {curves} = panel, wide = Math.max(panel.box.clientWidth, 100);
    const [low, high] = one.axis, scale = (wide - 2 * SIDE) / (high - low || 1);
    const px = (x) => SIDE + (x - low) * scale, py = (y) => BOTTOM - y * (BOTTOM - TOP);
    const path = (xs, ys) => xs.map((x, i) => `${i ? "L" : "M"}${px(x).toFixed(1)} ${py(ys[i]).toFixed(1)}`).join("");
    const filled = (xs, ys) => `${path(xs, ys)}L${px(xs[xs.length - 1])} ${BOTTOM}L${px(xs[0])} ${BOTTOM}Z`;
    panel.one = one;
    panel.unit.textContent = one.unit;
    panel.unit.className = "faint";
    panel.picture.setAttribute("viewBox", `0 0 ${wide} ${HIGH}`);
    curves.replaceChildren();
    const hatch = svg(curves, "pattern", {id: `hatch-${section}-${one.name}`, width: 6, height: 6, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)"});
    svg(hatch, "rect", {width: 2, height: 6, fill: "#d58a92"});
    svg(curves, "rect", {x: px(one.low), y: TOP, width: (one.high - one.low) * scale, height: BOTTOM - TOP, fill: "#f5f7f9"});
    for (const [from, to] of one.bare || []) {
      svg(curves, "rect", {class: "bare", x: px(from), y: TOP, width: Math.max((to - from) * scale, 2), height: BOTTOM - TOP, fill: `url(#hatch-${section}-${one.name})`});
    }
    if (one.union) svg(curves, "path", {d: filled(one.union.x, one.union.y), fill: "#8b94a1", opacity: 0.7});
    const ends = [0, 0]; // of the labels in each of two lines
    one.terms.forEach((term, t) => {
      const color = COLORS[t % COLORS.length], most = term.y.indexOf(Math.max(...term.y));
      if (!one.union) svg(curves, "path", {d: filled(term.x, term.y.map((y) => Math.min(y, term.degree))), fill: color, opacity: 0.3});
      svg(curves, "path", {d: path(term.x, term.y), fill: "none", stroke: color, "stroke-width": 1.8});
      const label = `${term.name} ${term.degree.toFixed(2)}`, size = 6.3 * label.length;
      const at = Math.min(Math.max(px(term.x[most]) - size / 2, 0), wide - size), row = ends[0] <= at || ends[0] <= ends[1] ? 0 : 1;
      svg(curves, "text", {x: Math.max(at, Math.min(ends[row], wide - size)), y: 11 + 13 * row, fill: color}, label);
      ends[row] = Math.max(at, ends[row]) + size + 6;
    });
    if (one.value !== null) svg(curves, "path", {d: `M${px(one.value)} ${TOP - 4}V${BOTTOM}`, stroke: NOW, "stroke-width": 2});
    for (const [x, anchor] of [[one.low, "start"], [one.high, "end"]]) svg(curves, "text", {x: px(x), y: HIGH - 4, fill: "#4d5765", "text-anchor": anchor}, rounded(x, high - low));
    const value = one.value === null ? "no rule concludes" : `${rounded(one.value, high - low)}${one.default === undefined || one.default === null ? "" : ` (without a rule ${one.default})`}`;
    svg(curves, "text", {x: px((one.low + one.high) / 2), y: HIGH - 4, fill: NOW, "text-anchor": "middle"}, value);
    if (panel.slider && document.activeElement !== panel.slider) Object.assign(panel.slider, {min: one.low, max: one.high, value: one.value});
    for (const {handle, t, n} of panel.handles) {
      const term = one.terms[t], values = numbers(term), [x, y] = SPOTS[term.kind](values)[n];
      handle.style.display = Number.isFinite(x) ? "" : "none"; // of an alias
      if (!Number.isFinite(x)) continue;
      const place = {cx: px(x), cy: py(y), "aria-valuenow": values[n], "aria-valuemin": low, "aria-valuemax": high, "aria-label": `${one.name} ${term.name}, ${NAMES[term.kind][n]}`};
      for (const [attribute, value] of Object.entries(place)) handle.setAttribute(attribute, value);
    }
  }

  // --- rules and surface -------------------------------------------------------------------------

  function drawRules(rules) {
    const list = part("rules");
    while (list.children.length > rules.length) list.lastChild.remove();
    rules.forEach((rule, n) => {
      const item = list.children[n] || addRule(list, n);
      item.title = `${rule.strength.toFixed(3)}`;
      item.querySelector("meter").value = rule.strength;
      item.querySelector("output").textContent = rule.strength.toFixed(2);
      const [slider, button] = [item.querySelector("input"), item.querySelector("button")];
      if (document.activeElement !== slider) slider.value = rule.weight;
      slider.ariaValueText = item.querySelector("span").textContent = `x ${rule.weight}`;
      button.textContent = rule.text;
      button.className = rule.strength > 0 ? "" : "idle";
    });
  }

  function addRule(list, n) {
    const item = list.appendChild(document.createElement("li"));
    item.innerHTML = '<div class="row"><output></output><meter min="0" max="1"></meter><input type="range" min="0.05" max="1" step="0.05"><span class="faint"></span></div><button type="button"></button>';
    const [slider, button] = [item.querySelector("input"), item.querySelector("button")];
    slider.ariaLabel = `weight of rule ${n + 1}`;
    item.querySelector("meter").ariaLabel = `strength of rule ${n + 1}`;
    slider.oninput = () => {
      const {at} = answered.view.rules[n];
      change(`weight.${n}`, at, at[0] === at[1] ? ` WITH ${slider.value}` : slider.value);
    };
    button.onclick = () => select(answered.view.rules[n].place);
    return item;
  }

  function drawSurface(view) {
    const of = view.surface, [pen, wide] = sharpPen(part("surface"), 260);
    const one = view.inputs.find((v) => v.name === of.x), two = view.inputs.find((v) => v.name === of.y);
    const columns = of.z.length / of.rows, left = 44, right = 62, high = 226, w = (wide - left - right) / columns, h = (high - 8) / of.rows;
    const color = shade([8, 69, 148], of.high - of.low), bare = new Set(of.bare);
    of.z.forEach((z, i) => {
      const x = left + i % columns * w, y = high - (Math.floor(i / columns) + 1) * h;
      pen.fillStyle = z === null ? "#fff" : color(z - of.low);
      pen.fillRect(x, y, w + 0.5, h + 0.5);
      if (!bare.has(i)) return;
      [pen.strokeStyle, pen.lineWidth] = ["#b9606a", 1];
      pen.beginPath();
      pen.moveTo(x, y + h);
      pen.lineTo(x + w, y);
      pen.stroke();
    });
    const px = left + (one.value - one.low) / (one.high - one.low) * (wide - left - right), py = high - (two.value - two.low) / (two.high - two.low) * (high - 8);
    for (const [ink, width] of [["#fff", 5], [NOW, 2.5]]) {
      [pen.strokeStyle, pen.lineWidth] = [ink, width];
      pen.beginPath();
      for (const s of [1, -1]) { pen.moveTo(px - 7, py - s * 7); pen.lineTo(px + 7, py + s * 7); }
      pen.stroke();
    }
    [pen.fillStyle, pen.strokeStyle, pen.lineWidth] = ["#4d5765", "#8b94a1", 1];
    pen.strokeRect(left, 8, wide - left - right, high - 8);
    for (const [value, y] of of.y === of.x ? [] : [[two.low, high], [two.high, 18]]) { pen.textAlign = "right"; pen.fillText(rounded(value, two.high - two.low), left - 5, y); }
    for (const [value, x, align] of [[one.low, left, "left"], [one.high, wide - right, "right"]]) { pen.textAlign = align; pen.fillText(rounded(value, one.high - one.low), x, high + 14); }
    pen.textAlign = "center";
    pen.fillText(`${of.x}${of.y === of.x ? "" : `; ${of.y} upwards`}; hatched: no rule`, (left + wide - right) / 2, high + 28);
    pen.textAlign = "left";
    for (let n = 0; n < 40; n++) { pen.fillStyle = color((39.5 - n) / 40 * (of.high - of.low)); pen.fillRect(wide - right + 14, 8 + n * (high - 8) / 40, 10, (high - 8) / 40 + 0.5); }
    pen.fillStyle = "#4d5765";
    for (const [value, y] of [[of.low, high], [of.high, 18]]) pen.fillText(rounded(value, of.high - of.low), wide - right + 28, y);
    for (const [id, names] of [["output", view.outputs], ["x", view.inputs], ["y", view.inputs]]) {
      const choice = part(`surface-${id}`);
      if (choice.options.length !== names.length || names.some((one, n) => choice.options[n].value !== one.name)) {
        choice.replaceChildren(...names.map((one) => new Option(one.name, one.name)));
      }
      choice.value = of[id];
      choice.onchange = () => { surface = {...surface, [id]: choice.value}; ask(); };
    }
  }

  function draw() {
    const {view} = answered, all = [...view.inputs, ...view.outputs];
    const now = JSON.stringify(all.map((one) => [one.name, one.terms.map((term) => [term.name, term.kind])]));
    if (now !== structure) {
      structure = now;
      panels.clear();
      part("inputs").replaceChildren();
      part("outputs").replaceChildren();
    }
    for (const section of ["inputs", "outputs"]) for (const one of view[section]) drawVariable(section, one);
    drawRules(view.rules);
    drawSurface(view);
    part("released").hidden = !run_known || !Object.keys(hand).length;
    if (run_known && moment) showMoment();
  }

  // --- the run -----------------------------------------------------------------------------------

  function showMoment() {
    const {v, w, leader, reason} = moment.command;
    drawRating(part("sum"), part("fused"), moment, run.grid, run.fusion);
    part("slider").value = moment.index;
    part("slider").ariaValueText = part("time").textContent = `${moment.time.toFixed(1)} s`;
    const was = `recorded: v ${run.v[moment.index].toFixed(2)} m/s, w ${run.w[moment.index].toFixed(2)} rad/s`;
    part("command").textContent = `v ${v.toFixed(2)} m/s, w ${w.toFixed(2)} rad/s, led by ${leader || "none"}: ${reason}; ${was}`;
    showCommands();
  }

  function showCommands() {
    const {times} = run, from = times[0], to = times[times.length - 1], shares = marks ? marks.where : [];
    const lit = marks ? shares.flatMap(([a, b]) => times.filter((t) => t >= a && t <= b).map((t) => [t, "#e8a33d"])) : [];
    for (const [id, column, color, label] of [["speeds", "v", "#0072B2", "v [m/s]; dashed: with these rules"], ["turns", "w", "#D55E00", "w [rad/s], left upwards"]]) {
      const lines = [{values: run[column], color}];
      if (marks && marks[column]) lines.push({values: marks[column], color: "#1c2430", dash: [4, 3]});
      drawChart(part(id), {time: times, lines, label, from, to, now: times[moment ? moment.index : 0], marks: lit});
    }
    const where = shares.slice(0, 12).map(([a, b]) => `${a.toFixed(1)} to ${b.toFixed(1)} s`).join(", ");
    const whose = area.value === file.text ? "the recording was made with other rules: with those of the file " : "";
    part("marks").textContent = !part("problem").hidden ? "not computed: the rules are refused" : !marks ? "computing the commands with these rules ..." : marks.note || (shares.length
      ? `${whose}commands differ at ${where}${shares.length > 12 ? `, and ${shares.length - 12} times more` : ""}`
      : "the same commands as in the recording");
  }

  function showOthers() {
    part("others").replaceChildren(...(run.others || []).slice(0, 20).map((rule) => {
      const item = document.createElement("li");
      item.textContent = `recorded with -, in the files now +: ${rule}`;
      return item;
    }));
  }

  // --- buttons -----------------------------------------------------------------------------------

  function begin(kind) {
    [next, part(kind).textContent] = ["", "Stop"];
    part("job").hidden = false;
    part("printed").textContent = part("done").textContent = "";
    part("compared").replaceChildren();
    part("job").scrollIntoView({block: "nearest"});
    send({op: kind});
  }
  for (const kind of ["test", "drive"]) {
    part(kind).onclick = () => {
      if (part(kind).textContent === "Stop") return send({op: "stop"});
      if (area.value === file.text) return begin(kind);
      next = kind; // what is driven or tested is the file
      send({op: "save", text: area.value, read: file.text});
    };
  }
  part("save").onclick = () => send({op: "save", text: area.value, read: file.text});
  part("undo").onclick = () => {
    if (!history.length) return;
    area.value = was = history.pop();
    last = "";
    underline([]);
    ask();
  };
  part("released").onclick = () => { hand = {}; ask(); };
  part("slider").oninput = () => { wanted = run.times[part("slider").value]; hand = {}; ask(); };
  for (const id of ["speeds", "turns"]) {
    part(id).onpointerdown = (event) => {
      const box = event.currentTarget.getBoundingClientRect(), {times} = run;
      const at = times[0] + (event.clientX - box.left - CHART_LEFT) / (box.width - CHART_LEFT - CHART_RIGHT) * (times[times.length - 1] - times[0]);
      wanted = times.reduce((best, time) => Math.abs(time - at) < Math.abs(best - at) ? time : best);
      hand = {};
      ask();
    };
  }
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.key !== "s") return;
    event.preventDefault();
    if (!part("save").disabled) part("save").onclick();
  });
  addEventListener("resize", () => { if (answered.view) draw(); });
})();
