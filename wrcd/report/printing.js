// Printing: every plot as a picture in light colours, as wide as the paper.

function onPrint(world) {
  const before = () => {
    document.documentElement.classList.add("printing");
    for (const pane of world.panes) {
      if (pane.view === null) continue;
      pane.theme();
      pane.update();
      pane.view.paint();
      pane.point(world.cursor);
      const picture = document.createElement("img");
      picture.className = "printed";
      picture.alt = pane.spec.title;
      picture.src = pane.view.export("png").canvas.toDataURL("image/png");
      pane.figure.append(picture);
    }
  };
  const after = () => {
    document.documentElement.classList.remove("printing");
    for (const picture of document.querySelectorAll("img.printed")) picture.remove();
    for (const pane of world.panes) pane.theme();
    world.ask();
  };
  addEventListener("beforeprint", before);
  addEventListener("afterprint", after);
}
