// The runs of a suite's report: charts, columns to sort, a filter, and a dialog with their pictures.
"use strict";
(function () {
  const viewer = document.getElementById("viewer");
  const filter = document.getElementById("filter");
  const rows = Array.from(document.querySelectorAll("tr[data-run]"));
  let shown = null;

  function show(row) {
    shown = row;
    viewer.querySelector("h2").textContent = row.dataset.run;
    const figures = Array.from(row.querySelectorAll("figure"), (figure) => figure.cloneNode(true));
    viewer.querySelector(".pictures").replaceChildren(...figures);
    if (!viewer.open) viewer.showModal();
  }

  function step(by) {
    const pictured = rows.filter((row) => !row.hidden && row.querySelector("img"));
    const next = pictured.indexOf(shown) + by;
    if (next >= 0 && next < pictured.length) show(pictured[next]);
  }

  function narrow() {
    const words = filter.value.toLowerCase().split(/\s+/).filter((word) => word);
    for (const row of rows) {
      const text = `${row.dataset.run} ${row.textContent}`.toLowerCase();
      const parts = text.split(/[\s,]+/); // a number is one whole part: seed 5 is not seed 15
      row.hidden = !words.every((word) => /^\d+$/.test(word) ? parts.includes(word) : text.includes(word));
    }
    const left = rows.filter((row) => !row.hidden).length;
    document.getElementById("count").textContent = words.length ? `${left} of ${rows.length}` : "";
  }

  document.addEventListener("click", (event) => {
    const button = event.target.closest("button");
    if (button === null) return;
    if (button.classList.contains("shot")) {
      if (!viewer.contains(button)) show(button.closest("tr"));
    } else if (button.dataset.step === "0") {
      viewer.close();
    } else {
      step(Number(button.dataset.step));
    }
  });
  document.addEventListener("keydown", (event) => {
    if (!viewer.open) return;
    if (event.key === "ArrowLeft") step(-1);
    if (event.key === "ArrowRight") step(1);
  });
  filter.addEventListener("input", narrow);

  // --- columns to sort by: numbers by value, in cells with data-sort by that ---
  function sort(head) {
    const table = head.closest("table"), column = head.cellIndex, body = table.tBodies[0];
    const down = head.ariaSort === "ascending";
    const value = (row) => {
      const cell = row.cells[column], text = cell.dataset.sort ?? cell.textContent.trim();
      return head.classList.contains("n") ? (Number.isNaN(parseFloat(text)) ? -Infinity : parseFloat(text)) : text;
    };
    const order = (a, b) => typeof a === "number" ? a - b : a.localeCompare(b, undefined, {numeric: true});
    const sorted = Array.from(body.rows).sort((a, b) => (down ? -1 : 1) * order(value(a), value(b)));
    for (const other of head.parentElement.cells) other.ariaSort = null;
    head.ariaSort = down ? "descending" : "ascending";
    body.append(...sorted);
  }
  for (const head of document.querySelectorAll("table.runs th")) {
    const button = document.createElement("button");
    [button.type, button.className, button.textContent] = ["button", "sort", head.textContent];
    button.onclick = () => sort(head);
    head.replaceChildren(button);
  }

  // --- charts: of a suite the distribution by group, of two the pairs ---
  const number = (row, name) => { const x = parseFloat(row.querySelector(`[data-name=${name}]`).textContent); return Number.isNaN(x) ? null : x; };
  const paired = document.getElementById("points");
  const points = paired ? JSON.parse(paired.textContent) : rows.map((row) => [row.dataset.group, row.dataset.stack,
    number(row, "SPL") || 0, number(row, "time"), number(row, "clearance"), row.querySelector("figcaption .good") !== null]);
  const figure = document.getElementById("figure"), told = document.getElementById("point");
  const canvas = document.getElementById("families") || document.getElementById("pairs");
  const INK = "#4d5765", GOOD = "#0072B2", BAD = "#B00020";
  let places = []; // of the points drawn: x, y, and what is said of it

  function spot(pen, x, y, color, text) {
    pen.fillStyle = color;
    pen.globalAlpha = 0.55;
    pen.beginPath();
    pen.arc(x, y, 3.5, 0, 7);
    pen.fill();
    pen.globalAlpha = 1;
    places.push([x, y, text]);
  }

  function drawFamilies() {
    const column = 2 + Number(figure.value), groups = new Map();
    for (const point of points) {
      const name = several ? `${point[0]}, ${point[1]}` : point[0];
      if (point[column] !== null) groups.set(name, [...(groups.get(name) || []), point]);
    }
    const shown = Array.from(groups).slice(0, 60), high = 34 * shown.length + 30;
    const [pen, wide] = sharpPen(canvas, high), left = Math.min(180, 0.35 * wide), right = 14;
    const [least, most] = minmax([0, ...points.map((point) => point[column]).filter((value) => value !== null)]);
    const px = (value) => left + (value - least) / (most - least || 1) * (wide - left - right);
    pen.textAlign = "center";
    for (let n = 0; n <= 4; n++) {
      const value = least + (most - least) * n / 4;
      pen.fillStyle = INK;
      pen.fillText(value.toFixed(most > 20 ? 0 : 2), px(value), high - 8);
      pen.fillStyle = "#d9dee5";
      pen.fillRect(px(value), 0, 1, high - 24);
    }
    shown.forEach(([name, of], n) => {
      const y = 34 * n + 16, values = of.map((point) => point[column]).sort((a, b) => a - b);
      const at = (share) => { const i = share * (values.length - 1), k = Math.floor(i); return values[k] + (i - k) * ((values[k + 1] ?? values[k]) - values[k]); };
      pen.fillStyle = INK;
      pen.textAlign = "right";
      pen.fillText(`${name} (${of.length})`, left - 8, y + 4, left - 12);
      if (of.length >= 5) { // quartiles and median
        pen.fillStyle = "#dbe6f2";
        pen.fillRect(px(at(0.25)), y - 11, Math.max(2, px(at(0.75)) - px(at(0.25))), 22);
      }
      of.forEach((point, i) => spot(pen, px(point[column]), y - 7 + 14 * ((i * 0.618) % 1), point[5] ? GOOD : BAD,
        `${name}: ${point[column].toFixed(2)}${point[5] ? "" : ", failed"}`));
      pen.fillStyle = "#1c2430";
      pen.fillRect(px(at(0.5)) - 1, y - 12, 2.5, 24);
    });
  }

  function drawPairs() {
    const column = Number(figure.value), known = points.filter((p) => p[1][column] !== null && p[2][column] !== null);
    const size = Math.min(canvas.clientWidth - 60, 420), [pen] = sharpPen(canvas, size + 50), left = 48, top = 8;
    const [least, most] = minmax([0, ...known.flatMap((p) => [p[1][column], p[2][column]])]);
    const px = (value) => left + (value - least) / (most - least || 1) * size, py = (value) => top + size - (px(value) - left);
    pen.strokeStyle = "#8b94a1";
    pen.strokeRect(left, top, size, size);
    pen.beginPath();
    pen.moveTo(left, top + size);
    pen.lineTo(left + size, top);
    pen.stroke();
    pen.fillStyle = INK;
    for (let n = 0; n <= 4; n++) {
      const value = least + (most - least) * n / 4, text = value.toFixed(most > 20 ? 0 : 2);
      pen.textAlign = "center";
      pen.fillText(text, px(value), top + size + 16);
      pen.textAlign = "right";
      pen.fillText(text, left - 6, py(value) + 4);
    }
    pen.textAlign = "center";
    pen.fillText(`A (${known.length} pairs; above the line B has more)`, left + size / 2, top + size + 34);
    pen.fillText("B", 10, top + size / 2);
    for (const [name, a, b] of known) {
      const by = b[column] - a[column], better = column === 1 ? -by : by;
      spot(pen, px(a[column]), py(b[column]), Math.abs(by) < 1e-9 ? INK : better > 0 ? GOOD : BAD,
        `${name}: ${a[column].toFixed(2)} in A, ${b[column].toFixed(2)} in B`);
    }
  }

  const several = new Set(points.map((point) => point[1])).size > 1;
  function draw() {
    places = [];
    (canvas.id === "families" ? drawFamilies : drawPairs)();
    canvas.dataset.points = places.length;
  }
  canvas.addEventListener("pointermove", (event) => {
    const box = canvas.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
    const near = places.filter((place) => Math.hypot(place[0] - x, place[1] - y) < 8);
    told.textContent = near.slice(0, 3).map((place) => place[2]).join("; ");
  });
  figure.addEventListener("change", draw);
  addEventListener("resize", draw);
  draw();
})();
