// SPDX-License-Identifier: MIT
// Boxes of the modal table and the buttons that save what is chosen.
"use strict";

(function () {
  const holder = document.getElementById("modes-data");
  if (!holder) return;
  const { result, uff } = JSON.parse(holder.textContent);
  const boxes = [...document.querySelectorAll("input[data-mode]")], count = document.querySelector(".save .chosen");
  const numbers = () => boxes.filter((box) => box.checked).map((box) => Number(box.dataset.mode)).sort((a, b) => a - b);
  const makers = {
    csv: ["text/csv", (list) => okidSelection.csv(result, list)],
    json: ["application/json", (list) => okidSelection.json(result, list)],
    uff: ["text/plain", (list) => uff.head + list.map((k) => uff.modes[k - 1]).join("")],
  };

  function tell() {
    const list = numbers();
    count.textContent = list.length ? `${list.length} of ${boxes.length} modes selected` : "no mode selected";
    for (const button of document.querySelectorAll("button[data-save]")) button.disabled = !list.length;
  }

  boxes.forEach((box) => box.addEventListener("change", tell));
  document.querySelectorAll("button[data-save]").forEach((button) => button.addEventListener("click", () => {
    const [kind, make] = makers[button.dataset.save];
    okidSelection.save(`modes.${button.dataset.save}`, kind, make(numbers()));
  }));
  tell();
})();
