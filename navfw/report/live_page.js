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

  function picture(bytes) { // of a message CompressedImage
    const message = cdr(bytes);
    message.count(); message.count(); message.blob(); message.blob();
    return createImageBitmap(new Blob([message.blob()]));
  }

  const show = {
    "/camera/image"(bytes) { picture(bytes).then((image) => { newest.image = image; redraw(); }); },
    "/chase/image"(bytes) { picture(bytes).then((image) => part("chase").getContext("2d").drawImage(image, 0, 0)); },
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
    "/path"(bytes) { newest.way = (fields(bytes)[3] || []).map((p) => pose(fields(p))).map((p) => [p.x, p.y]); },
    "/moving_obstacles"(bytes) {
      const entity = one(fields(bytes), 2);
      newest.movers = (entity[10] || []).map((cylinder) => {
        const body = fields(cylinder), at = pose(one(body, 1));
        return [...placed(odom, [at.x, at.y]), number(one(body, 2), 1) / 2];
      });
      newest.courses = (entity[11] || []).map((line) => fields(line)[5].map((p) => placed(odom, point(p))));
    },
    "/moving_obstacles/true"(bytes) {
      newest.walkers = (one(fields(bytes), 2)[10] || []).map((cylinder) => {
        const body = fields(cylinder), at = pose(one(body, 1));
        return [at.x, at.y, number(one(body, 2), 1) / 2];
      });
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

  const drawPlan = makePlan(part("plan"), data, redraw);

  function drawCommands() {
    const time = commands.map((row) => row[0]), marks = [];
    for (const [id, column, [low, high], color, label] of [["speeds", 1, data.v, "#0072B2", "v [m/s]"], ["turns", 2, data.w, "#D55E00", "w [rad/s], left upwards"]]) {
      const lines = [{values: commands.map((row) => row[column]), color}];
      drawChart(part(id), {time, lines, label, from: Math.max(0, now - 60), to: Math.max(60, now), low, high, marks});
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
      drawPlan(path, newest);
      drawCommands();
    });
  }

  function showState(told) {
    state = told;
    part("state").className = told.ended ? (told.ended.startsWith("reached") ? "good" : "bad") : "";
    part("state").textContent = told.ended || (told.paused ? "paused" : "running");
    part("pause").textContent = told.paused ? "Resume" : "Pause";
    const speed = told.speed === null ? "" : String(told.speed), choice = part("speed");
    choice.value = speed;
    if (choice.value !== speed) choice.add(new Option(`${speed} x real time`, speed, false, true));
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
  const restarted = 1012;
  socket.onclose = ({code}) => code === restarted ? location.reload() : showState({...state, speed: state.speed ?? null, ended: state.ended || "the connection is lost"});
  const command = (change) => socket.send(JSON.stringify({op: "navfw", paused: state.paused, speed: state.speed, ...change}));
  part("pause").onclick = () => command({paused: !state.paused});
  part("speed").onchange = (event) => command({speed: event.target.value ? Number(event.target.value) : null});
  addEventListener("resize", redraw);
  redraw();
})();
