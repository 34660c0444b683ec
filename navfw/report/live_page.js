// The page of a running mission: it subscribes to channels of the live server, and draws the newest.
"use strict";
(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  const part = (id) => document.getElementById(id);
  const text = (bytes) => new TextDecoder().decode(bytes);
  const newest = {cells: [], flow: []};
  const path = [], commands = [];
  let odom = {x: 0, y: 0, yaw: 0}, state = {}, now = 0, due = false;

  // A message of protobuf: the values of each field, by its number; messages and texts as bytes.
  function fields(bytes) {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length), result = {};
    let at = 0;
    const varint = () => {
      let value = 0, byte, place = 1;
      do { byte = bytes[at++]; value += (byte & 127) * place; place *= 128; } while (byte > 127);
      return value;
    };
    while (at < bytes.length) {
      const key = varint(), kind = key % 8;
      let value;
      if (kind === 0) value = varint();
      else if (kind === 1) { value = view.getFloat64(at, true); at += 8; }
      else if (kind === 5) { value = view.getFloat32(at, true); at += 4; }
      else { const size = varint(); value = bytes.subarray(at, at + size); at += size; }
      (result[key >> 3] ||= []).push(value);
    }
    return result;
  }
  const one = (message, number) => fields((message[number] || [new Uint8Array()])[0]);
  const number = (message, field) => (message[field] || [0])[0];
  const point = (bytes) => { const p = fields(bytes); return [number(p, 1), number(p, 2)]; };
  function pose(message) { // of a message Pose
    const place = one(message, 1), turn = one(message, 2);
    return {x: number(place, 1), y: number(place, 2), yaw: 2 * Math.atan2(number(turn, 3), number(turn, 4))};
  }

  // A reader of CDR, little-endian.
  function cdr(bytes) {
    const view = new DataView(bytes.buffer, bytes.byteOffset + 4, bytes.length - 4);
    let at = 0;
    const sized = (size) => { at = Math.ceil(at / size) * size; at += size; return at - size; };
    const count = () => view.getUint32(sized(4), true);
    const blob = () => { const size = count(); at += size; return bytes.subarray(4 + at - size, 4 + at); };
    return {count, blob, real: () => view.getFloat64(sized(8), true)};
  }

  const show = {
    "/camera/image"(bytes) {
      const message = cdr(bytes);
      message.count(); message.count(); message.blob(); message.blob();
      createImageBitmap(new Blob([message.blob()])).then((image) => { newest.image = image; redraw(); });
    },
    "/flow"(bytes) { newest.flow = annotated(bytes).flatMap((group) => group[1]); },
    "/percept/cells"(bytes) { newest.cells = annotated(bytes); },
    "/percept"(bytes) {
      const percept = JSON.parse(text(bytes));
      part("sentence").textContent = percept.sentence || "Nothing perceived yet.";
      for (const [quadrant, terms] of Object.entries(percept.quadrants)) {
        const shown = Object.entries(terms).filter((term) => term[1] > 0.005);
        part(quadrant).textContent = shown.map(([name, degree]) => `${name} ${degree.toFixed(2)}`).join(", ") || "nothing";
      }
    },
    "/tf"(bytes) {
      const message = cdr(bytes);
      for (let i = 0; i < 5; i++) if (i < 3) message.count(); else message.blob();
      const [x, y, , , , z, w] = Array.from({length: 7}, message.real);
      odom = {x, y, yaw: 2 * Math.atan2(z, w)};
    },
    "/pose"(bytes) { newest.estimate = pose(one(fields(bytes), 4)); },
    "/pose/true"(bytes) {
      newest.robot = pose(one(fields(bytes), 3));
      path.push([newest.robot.x, newest.robot.y, (newest.command || {}).leader || "none"]);
    },
    "/path"(bytes) { newest.way = (fields(bytes)[3] || []).map((p) => pose(fields(p))); },
    "/moving_obstacles"(bytes) {
      const entity = one(fields(bytes), 2);
      newest.movers = (entity[10] || []).map((cylinder) => {
        const body = fields(cylinder), at = placed(odom, pose(one(body, 1)));
        return [at.x, at.y, number(one(body, 2), 1) / 2];
      });
      newest.courses = (entity[11] || []).map((line) => fields(line)[5].map(point)
        .map(([x, y]) => placed(odom, {x, y, yaw: 0})).map((p) => [p.x, p.y]));
    },
    "/command"(bytes) {
      const command = newest.command = JSON.parse(text(bytes));
      if (command.leader === undefined) return;
      commands.push([now, command.v, command.w]);
      while (commands[0][0] < now - 60) commands.shift();
      part("drive").textContent = `v ${command.v.toFixed(2)} m/s, w ${command.w.toFixed(2)} rad/s, led by ` +
        `${command.leader || "none"}: ${command.reason}`;
    },
    "/command/rules"(bytes) {
      const fired = JSON.parse(text(bytes));
      if (!fired.behaviors) return;
      const rules = (of) => of.rules.map((rule) => `    ${rule.strength.toFixed(2)}  ${rule.rule}`);
      const ordered = Object.entries(fired.behaviors).sort((a, b) => b[1].weight - a[1].weight);
      part("rules").textContent = ordered.flatMap(([name, of]) =>
        [`${name === fired.leader ? "\u25b6 " : ""}${name}: weight ${of.weight.toFixed(2)}, desirability ` +
         `${of.desirability.toFixed(2)}, prohibition ${of.prohibition.toFixed(2)} - ${of.reason}`, ...rules(of)]).join("\n");
    },
  };

  function annotated(bytes) { // the groups of points, each with its colour, in sixteenths of a pixel
    return (fields(bytes)[2] || []).map((group) => {
      const content = fields(group), color = one(content, 4);
      const [r, g, b] = [1, 2, 3].map((n) => Math.round(255 * number(color, n)));
      return [`rgba(${r}, ${g}, ${b}, ${number(color, 4)})`, (content[3] || []).flatMap((p) => point(p).map((x) => 16 * x))];
    });
  }

  function placed(frame, p) {
    const c = Math.cos(frame.yaw), s = Math.sin(frame.yaw);
    return {x: frame.x + c * p.x - s * p.y, y: frame.y + s * p.x + c * p.y, yaw: frame.yaw + p.yaw};
  }

  function sharp(canvas, ratio) { // its pen, for a height of ratio times its width, in CSS pixels
    const wide = canvas.clientWidth, high = Math.min(ratio * wide, 520), dense = window.devicePixelRatio;
    canvas.style.height = `${high}px`;
    canvas.width = wide * dense;
    canvas.height = high * dense;
    const pen = canvas.getContext("2d");
    pen.scale(dense, dense);
    return [pen, wide, high];
  }

  function drawPlan() {
    const [x0, y0, x1, y1] = data.bounds;
    const [pen, wide, high] = sharp(part("plan"), (y1 - y0) / (x1 - x0));
    const scale = Math.min(wide / (x1 - x0), high / (y1 - y0));
    const px = (x) => (x - x0) * scale, py = (y) => high - (y - y0) * scale;
    function draw(shape) {
      pen.fillStyle = shape.fill || "transparent";
      pen.strokeStyle = shape.edge || "transparent";
      pen.lineWidth = shape.width || 1;
      pen.setLineDash(shape.dash || []);
      const trace = new Path2D();
      for (const [x, y, r] of shape.discs || []) {
        trace.moveTo(px(x) + r * scale, py(y));
        trace.arc(px(x), py(y), r * scale, 0, 7);
      }
      for (const [x, y] of shape.marks || []) {
        for (let i = 0; i < 10; i++) {
          const r = i % 2 ? 4 : 9, turn = Math.PI * (i / 5 - 0.5);
          trace[i ? "lineTo" : "moveTo"](px(x) + r * Math.cos(turn), py(y) + r * Math.sin(turn));
        }
      }
      for (const [x, y] of shape.area || shape.line || []) trace.lineTo(px(x), py(y));
      if (shape.area) trace.closePath();
      if (!shape.line) pen.fill(trace);
      pen.stroke(trace);
    }
    pen.font = "12px system-ui, sans-serif";
    data.shapes.forEach(draw);
    for (let i = 1, from = 0; i <= path.length; i++) {
      if (i < path.length && path[i][2] === path[from][2]) continue;
      draw({line: path.slice(Math.max(from - 1, 0), i), edge: data.colors[path[from][2]] || data.colors.none, width: 4});
      from = i;
    }
    [pen.fillStyle, pen.strokeStyle, pen.lineWidth] = ["#1c2430", "#fff", 3];
    const written = []; // of the places' names, those with room
    for (const [name, x, y] of data.places) {
      const size = pen.measureText(name).width + 6, left = Math.min(px(x) + 5, wide - size), low = py(y) - 4;
      pen.fillRect(px(x) - 2, py(y) - 2, 4, 4);
      if (written.some((w) => left < w[0] + w[2] && w[0] < left + size && Math.abs(low - w[1]) < 14)) continue;
      written.push([left, low, size]);
      pen.strokeText(name, left, low);
      pen.fillText(name, left, low);
    }
    for (const course of newest.courses || []) draw({line: course, edge: data.moving, width: 2});
    draw({discs: newest.movers || [], fill: data.moving});
    if (newest.way) draw({line: newest.way.map((p) => [p.x, p.y]), edge: data.goal, width: 2, dash: [2, 4]});
    const bodies = (at) => data.discs.map(([x, y, r]) => { const p = placed(at, {x, y, yaw: 0}); return [p.x, p.y, r]; });
    if (newest.robot) {
      const robot = newest.robot, nose = placed(robot, {x: 1.6 * data.discs[0][2], y: 0, yaw: 0});
      draw({discs: bodies(robot), fill: "#fff", edge: "#000", width: 2});
      draw({line: [[robot.x, robot.y], [nose.x, nose.y]], edge: "#000", width: 2});
    }
    if (newest.estimate) draw({discs: bodies(newest.estimate), edge: data.estimate, dash: [4, 3]});
  }

  function drawCommands() {
    const [pen, wide, high] = sharp(part("commands"), 0.35);
    pen.font = "12px system-ui, sans-serif";
    pen.fillStyle = "#5b6675";
    for (const [column, [low, high_], color, unit] of [[1, data.v, "#0072B2", "m/s"], [2, data.w, "#D55E00", "rad/s"]]) {
      const top = (column - 1) * high / 2, size = high / 2 - 6;
      const y = (value) => top + 2 + size * (1 - (value - low) / (high_ - low || 1));
      pen.strokeStyle = "#d9dee5";
      pen.strokeRect(70, top + 2, wide - 72, size);
      pen.fillText(`${high_.toFixed(1)} ${unit}`, 0, top + 14);
      pen.fillText(low.toFixed(1), 0, top + size);
      pen.strokeStyle = color;
      pen.lineWidth = 2;
      pen.beginPath();
      for (const row of commands) pen.lineTo(wide - 2 - (now - row[0]) / 60 * (wide - 72), y(row[column]));
      pen.stroke();
      pen.lineWidth = 1;
    }
  }

  function redraw() {
    if (due) return;
    due = true;
    requestAnimationFrame(() => {
      due = false;
      part("time").textContent = `${now.toFixed(1)} s`;
      const image = newest.image, canvas = part("camera");
      if (image) {
        if (canvas.width !== 4 * image.width) [canvas.width, canvas.height] = [4 * image.width, 4 * image.height];
        drawCamera(canvas, 4, data.flow, newest, image);
      }
      drawPlan();
      drawCommands();
    });
  }

  function showState(told) {
    state = told;
    part("state").className = told.ended ? (told.ended.startsWith("reached") ? "good" : "bad") : "";
    part("state").textContent = told.ended || (told.paused ? "paused" : "running");
    part("pause").textContent = told.paused ? "Resume" : "Pause";
    part("speed").value = told.speed === null ? "" : String(told.speed);
    part("pause").disabled = part("speed").disabled = Boolean(told.ended);
  }

  for (const [name, color] of Object.entries(data.colors)) {
    const entry = document.createElement("span");
    entry.innerHTML = "<i></i>";
    entry.firstChild.style.background = color;
    entry.append(name);
    part("led").append(entry, " ");
  }
  const socket = new WebSocket(`ws://${location.host}/${location.search}`, ["navfw.live.v1"]);
  socket.binaryType = "arraybuffer";
  const topics = {};
  socket.onmessage = (event) => {
    if (typeof event.data !== "string") {
      const view = new DataView(event.data);
      now = Number(view.getBigUint64(view.getUint8(0) === 1 ? 5 : 1, true)) / 1e9;
      if (view.getUint8(0) === 1) topics[view.getUint32(1, true)](new Uint8Array(event.data, 13));
      return redraw();
    }
    const message = JSON.parse(event.data);
    if (message.op === "navfw") showState(message);
    if (message.op !== "advertise") return;
    const wanted = message.channels.filter((channel) => show[channel.topic]);
    for (const channel of wanted) topics[channel.id] = show[channel.topic];
    const subscriptions = wanted.map(({id}) => ({id, channelId: id}));
    socket.send(JSON.stringify({op: "subscribe", subscriptions}));
  };
  socket.onclose = () => showState({...state, speed: state.speed ?? null, ended: state.ended || "the connection is lost"});
  const command = (change) => socket.send(JSON.stringify({op: "navfw", paused: state.paused, speed: state.speed, ...change}));
  part("pause").onclick = () => command({paused: !state.paused});
  part("speed").onchange = (event) => command({speed: event.target.value ? Number(event.target.value) : null});
  addEventListener("resize", redraw);
  redraw();
})();
