// The report of a run: it shows one moment in all panels, plays, and goes from event to event.
"use strict";
(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  const part = (id) => document.getElementById(id);
  const {moments, rows, grid} = data, slider = part("slider"), camera = part("camera");
  const maps = data.maps.map((source) => { const image = new Image(); image.src = source; return image; });
  const path = rows ? rows.x.map((x, i) => [x, rows.y[i], rows.leader[i]]).filter((row) => row[0] !== null) : [];
  const believed = rows ? rows.believed_x.map((x, i) => [x, rows.believed_y[i]]).filter((p) => p[0] !== null) : [];
  const from = (time) => { // the first moment at a time or after it
    const after = moments.findIndex((moment) => moment.time > time - 1e-6);
    return after < 0 ? moments.length - 1 : after;
  };
  const events = data.events.map((event) => ({...event, moment: from(event.time)}));
  const contacts = events.filter((event) => event.point).map((event) => [...event.point, data.contact]);
  const drawPlan = rows && makePlan(part("plan"), data, () => requestAnimationFrame(showPlan));
  let number = 0, playing = null;

  function showText(moment) {
    const command = moment.command;
    part("time").textContent = moment.time.toFixed(1) + " s";
    part("link").href = `#t=${moment.time.toFixed(2)}`;
    part("sentence").textContent = moment.sentence || "Nothing perceived yet.";
    part("rules").textContent = moment.rules || "No command yet.";
    part("drive").textContent = command.leader === undefined ? "No command yet."
      : `v ${command.v.toFixed(2)} m/s, w ${command.w.toFixed(2)} rad/s, led by ` +
        `${command.leader || "none"}: ${command.reason}${command.held ? `; held: ${command.held}` : ""}`;
    part("event").textContent = events.filter((event) => event.moment === number).map((event) => event.text).join("; ");
    links.forEach((link, n) => { link.ariaCurrent = events[n].moment === number ? "true" : null; });
  }

  function showCamera(moment) {
    const image = new Image(), shown = number;
    image.onload = () => {
      if (number !== shown) return;
      drawCamera(camera, camera.width / data.size[0], data.flow, moment, image);
      camera.dataset.shown = number;
    };
    image.src = moment.image;
    if (moment.chase) part("chase").src = moment.chase;
  }

  function showInputs(moment) { // of the leader's rules, each with its terms
    const known = (data.inputs[moment.command.leader] || []).filter((one) => one.name in moment.inputs);
    part("inputs").replaceChildren(...known.map((one) => {
      const box = document.createElement("div"), title = document.createElement("span"), value = moment.inputs[one.name];
      title.textContent = `${one.name} ${Number(value.toPrecision(3))} ${one.unit}`;
      box.append(title, Object.assign(document.createElement("canvas"), {className: "chart", role: "img", ariaLabel: title.textContent}));
      return box;
    }));
    known.forEach((one, n) => drawTerms(part("inputs").children[n].lastChild, one, moment.inputs[one.name]));
  }

  function showPlan() {
    const moment = moments[number], map = moment.map;
    const image = map && maps[map[0]];
    if (image && !image.complete) image.onload = () => requestAnimationFrame(showPlan);
    drawPlan(path, {...moment, believed, marks: contacts, map: image && image.complete ? {...map[1], size: map[2], image} : null});
  }

  function showCharts(moment) {
    const time = rows.time, to = time[time.length - 1], begin = Math.min(0, time[0]);
    const marks = events.map((event) => [moments[event.moment].time, event.kind === "contact" ? data.contact : "#8b94a1"]);
    const blue = "#0072B2", orange = "#D55E00";
    for (const [id, label, columns, color, low, high] of [
      ["chart-speed", "speed v [m/s]", ["v", "driven_v", "if_v"], blue], ["chart-turn", "turn w [rad/s], left upwards", ["w", "driven_w", "if_w"], orange],
      ["chart-clearance", "clearance [m]", ["clearance"], blue], ["chart-confidence", "confidence of the position", ["confidence"], orange, 0, 1]]) {
      const lines = columns.filter((name) => rows[name]).map((name, n) => name.startsWith("if_")
        ? {values: rows[name], color: "#009E73"} : {values: rows[name], color, dash: n ? [2, 3] : []});
      drawChart(part(id), {time, lines, label, from: begin, to, now: moment.time, marks, low, high});
    }
    let row = time.findIndex((t) => t > moment.time + 1e-6);
    row = row < 0 ? time.length - 1 : Math.max(row - 1, 0);
    const told = (name, unit) => rows[name][row] === null ? "unknown" : `${rows[name][row].toFixed(2)}${unit}`;
    part("values").textContent = `At ${moment.time.toFixed(1)} s: v ${told("v", " m/s")}, w ${told("w", " rad/s")}, ` +
      `clearance ${told("clearance", " m")}, confidence ${told("confidence", "")}`;
  }

  const lines = !grid ? [] : grid.names.map((name) => { // of the table of behaviours
    const line = part("parts").insertRow();
    const [title, weight, share, mine, forbids] = Array.from({length: 5}, () => line.insertCell());
    const patch = title.appendChild(document.createElement("i"));
    patch.style.background = data.colors[name] || "#9a9a9a";
    title.append(name);
    weight.className = share.className = "n";
    return {line, weight, share, mine: mine.appendChild(document.createElement("canvas")), forbids: forbids.appendChild(document.createElement("canvas"))};
  });

  const links = events.map((event) => {
    const line = part("events").appendChild(document.createElement("li")), link = line.appendChild(document.createElement("a"));
    link.href = `#t=${moments[event.moment].time.toFixed(2)}`;
    link.textContent = `${event.time.toFixed(1)} s`;
    line.append(` ${event.text}`);
    return link;
  });

  function showRatings(moment) {
    const size = grid.v.length * grid.w.length;
    const {known, rated, cross, cell, blue} = drawRating(part("sum"), part("fused"), moment, grid, data.fusion);
    const forbids = known ? Uint8Array.from(atob(moment.prohibition), (c) => c.charCodeAt(0)) : new Uint8Array(size * grid.names.length);
    const idle = (n) => !rated.weight[n] && !forbids.subarray(n * size, (n + 1) * size).some((degree) => degree);
    part("idle").textContent = known ? grid.names.filter((_, n) => idle(n)).join(", ") || "none" : "";
    lines.forEach(({line, weight, share, mine, forbids: canvas}, n) => {
      line.hidden = known && idle(n);
      if (line.hidden) return;
      weight.textContent = `${(100 * rated.weight[n]).toFixed(0)} %`;
      share.textContent = cell === null ? "" : rated.parts[n][cell].toFixed(2);
      drawCommands(mine, grid, rated.parts[n], {color: blue, high: 44, cross});
      drawCommands(canvas, grid, forbids.subarray(n * size, (n + 1) * size), {color: shade([153, 0, 13], 255), high: 44, cross});
    });
  }

  function show(wanted) {
    number = Math.min(Math.max(wanted, 0), moments.length - 1);
    slider.value = number;
    const moment = moments[number];
    slider.ariaValueText = `${moment.time.toFixed(1)} s`;
    showText(moment);
    showCamera(moment);
    if (rows) showPlan();
    if (rows) showCharts(moment);
    if (grid) showRatings(moment);
    if (part("inputs")) showInputs(moment);
  }

  function nearest(time) {
    return moments.reduce((best, moment, n) => Math.abs(moment.time - time) < Math.abs(moments[best].time - time) ? n : best, 0);
  }

  function go(wanted) { // by hand: the page's address is then a link to the moment
    play(false);
    show(wanted);
    history.replaceState(null, "", part("link").href);
  }

  function event(by) {
    const ahead = events.map((e) => e.moment).filter((n) => by > 0 ? n > number : n < number);
    if (ahead.length) go(by > 0 ? Math.min(...ahead) : Math.max(...ahead));
  }

  function play(on) {
    if (playing !== null) cancelAnimationFrame(playing);
    playing = null;
    part("play").textContent = on ? "Pause" : "Play";
    if (!on) return;
    if (number === moments.length - 1) show(0);
    let clock = moments[number].time, before = performance.now();
    const tick = (now) => {
      clock += 1e-3 * (now - before) * Number(part("speed").value);
      before = now;
      let next = number;
      while (next < moments.length - 1 && moments[next + 1].time <= clock) next++;
      if (next !== number) show(next);
      if (next === moments.length - 1) return play(false);
      playing = requestAnimationFrame(tick);
    };
    playing = requestAnimationFrame(tick);
  }

  function fromAddress() {
    const time = Number((location.hash.match(/^#t=([\d.]+)$/) || [])[1]);
    if (!Number.isNaN(time)) play(false);
    show(Number.isNaN(time) ? from(data.first) : nearest(time));
  }

  slider.addEventListener("input", () => go(Number(slider.value)));
  part("play").onclick = () => play(playing === null);
  part("before").onclick = () => event(-1);
  part("after").onclick = () => event(1);
  document.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.altKey || e.metaKey || e.target.closest("select, dialog")) return;
    if (e.key === "n") event(1);
    if (e.key === "p") event(-1);
    if (e.target.closest("input, button, a, pre")) return;
    if (e.key === " ") { e.preventDefault(); play(playing === null); }
    if (e.key === "ArrowRight") go(number + 1);
    if (e.key === "ArrowLeft") go(number - 1);
  });
  for (const canvas of document.querySelectorAll("canvas[id^=chart-]")) {
    const seek = (e) => {
      const box = e.currentTarget.getBoundingClientRect(), time = rows.time;
      const share = (e.clientX - box.left - CHART_LEFT) / (box.width - CHART_LEFT - CHART_RIGHT), begin = Math.min(0, time[0]);
      go(nearest(begin + share * (time[time.length - 1] - begin)));
    };
    canvas.addEventListener("pointerdown", seek);
    canvas.addEventListener("pointermove", (e) => { if (e.buttons) seek(e); });
  }
  addEventListener("hashchange", fromAddress);
  addEventListener("resize", () => show(number));
  fromAddress();
})();
