// The runs of a suite's report: a filter over their texts, and a dialog with their pictures.
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
})();
