// The slider of a run's report: it shows one moment in camera, plan, ratings, rules and timelines.
"use strict";
(function () {
  const data = JSON.parse(document.getElementById("moments").textContent);
  const slider = document.getElementById("slider");
  const canvas = document.getElementById("camera");

  function showText(moment) {
    const command = moment.command;
    document.getElementById("time").textContent = moment.time.toFixed(1) + " s";
    document.getElementById("sentence").textContent = moment.sentence || "Nothing perceived yet.";
    document.getElementById("rules").textContent = moment.rules || "No command yet.";
    document.getElementById("drive").textContent = command.leader === undefined ? "No command yet."
      : `v ${command.v.toFixed(2)} m/s, w ${command.w.toFixed(2)} rad/s, led by ` +
        `${command.leader || "none"}: ${command.reason}`;
  }

  function fields(text, high, wide) {
    const image = [];
    const bytes = text ? atob(text) : "";
    for (let row = 0; row < high; row++) {
      image.push(Array.from({length: wide}, (_, i) => bytes.charCodeAt(row * wide + i) || 0));
    }
    return image;
  }

  function showRatings(page, moment) {
    const grid = data.grid;
    const high = grid.count * (grid.speeds + 1);
    for (const name of ["desires", "forbids"]) {
      const pixels = page.get_model_by_name(name).data.image[0];
      fields(moment[name], high, grid.turns).flat().forEach((value, i) => { pixels[i] = value; });
      page.get_model_by_name(name).change.emit();
    }
    const chosen = {x: [], y: []};
    if (moment.command.leader !== undefined && moment.desires) {
      const turn = grid.turns - 1 - (moment.command.w - grid.w[0]) / grid.w[1] + 0.5;
      const speed = (moment.command.v - grid.v[0]) / grid.v[1] + 0.5;
      for (let n = 0; n < grid.count; n++) {
        for (const left of [0, grid.turns + 1]) {
          chosen.x.push(left + turn);
          chosen.y.push(n * (grid.speeds + 1) + speed);
        }
      }
    }
    page.get_model_by_name("chosen").data = chosen;
  }

  function showFigures(page, moment) {
    const robot = moment.robot ? {x: [moment.robot[0]], y: [moment.robot[1]]} : {x: [], y: []};
    page.get_model_by_name("robot").data = robot;
    page.get_model_by_name("way").data = {x: moment.way.map((p) => p[0]), y: moment.way.map((p) => p[1])};
    for (const name of ["command", "clearance", "confidence"]) {
      page.get_model_by_name("now-" + name).location = moment.time;
    }
    if (data.grid) showRatings(page, moment);
  }

  function show() {
    const number = Number(slider.value);
    const moment = data.moments[number];
    showText(moment);
    const image = new Image();
    image.onload = () => {
      if (Number(slider.value) !== number) return;
      drawCamera(canvas, canvas.width / data.size[0], data.flow_color, moment, image);
      canvas.dataset.shown = number;
    };
    image.src = moment.image;
    if (window.Bokeh !== undefined && Bokeh.documents.length) showFigures(Bokeh.documents[0], moment);
  }

  function start() {
    if (window.Bokeh !== undefined && !Bokeh.documents.length) return setTimeout(start, 20);
    slider.addEventListener("input", show);
    show();
  }
  start();
})();
