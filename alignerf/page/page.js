// Two layers of one view under the slider.
"use strict";
(() => {
  const read = (id) => JSON.parse(document.getElementById(id).textContent);
  const images = read("images"), layers = read("layers");
  const view = document.getElementById("view");
  if (!view) return;
  const sides = [
    [document.getElementById("left"), document.getElementById("first")],
    [document.getElementById("right"), document.getElementById("second")],
  ];
  const wanted = ["photo", "render"];

  function fill(select, names, chosen) {
    select.replaceChildren(...names.map((name) => new Option(name, name)));
    select.value = names.includes(chosen) ? chosen : names[0];
  }

  function show() {
    const found = images[view.value];
    const names = layers.filter((name) => name in found);
    sides.forEach(([select, image], side) => {
      fill(select, names, wanted[side]);
      image.src = found[select.value];
      image.alt = `${select.value} of view ${view.value}`;
    });
    const option = view.selectedOptions[0];
    document.getElementById("note").textContent = option.dataset.note;
  }

  // As high as the window, whatever the view's shape.
  sides[0][1].addEventListener("load", ({ target }) => {
    const shape = target.naturalWidth / target.naturalHeight;
    document.getElementById("slider").style.setProperty("--shape", shape);
  });
  view.addEventListener("change", show);
  sides.forEach(([select], side) => select.addEventListener("change", () => {
    wanted[side] = select.value;
    show();
  }));
  // From the table of all photos to the images of one.
  document.querySelectorAll("#views tbody tr").forEach((row) => {
    const [name, split] = [...row.cells].map((cell) => cell.textContent);
    if (!(`${split}/${name}` in images)) return;
    const link = document.createElement("a");
    link.href = "#look";
    link.textContent = name;
    link.addEventListener("click", () => {
      view.value = `${split}/${name}`;
      show();
    });
    row.cells[0].replaceChildren(link);
  });
  show();
})();
