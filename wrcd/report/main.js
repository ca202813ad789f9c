// Starts the page: unpacks the data, then builds the plots in view, then the others.

function trouble(text) {
  const element = document.getElementById("trouble");
  element.textContent = text;
  element.hidden = false;
}

async function start() {
  if (typeof DecompressionStream === "undefined") {
    trouble("This browser cannot unpack the data of the plots (it lacks DecompressionStream): "
      + "Chrome and Edge can from 80 on, Firefox from 113, Safari from 16.4. Verdict and tables are complete without.");
    return;
  }
  const element = document.getElementById("told");
  const told = JSON.parse(new TextDecoder().decode(await inflate(element.textContent)));
  element.remove();
  const world = new World(told, await unpackAll(told.tables));
  const words = new Words(told, world);
  world.listeners.push(() => words.show());
  for (const figure of document.querySelectorAll("figure[data-plot]")) {
    const pane = new Pane(figure, told.plots[figure.dataset.plot], world);
    world.panes.push(pane);
    byMouse(world, pane);
  }
  byKeys(world);
  byButtons(world);
  onPrint(world);
  const watch = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const pane = world.panes.find((p) => p.figure === entry.target);
      pane.visible = entry.isIntersecting;
      if (pane.visible) pane.build().then(() => world.ask());
    }
  });
  for (const pane of world.panes) watch.observe(pane.figure);
  new ResizeObserver(() => world.show(world.from, world.to)).observe(document.querySelector("main"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    for (const pane of world.panes) pane.theme();
    world.ask();
  });
  world.ask();
  await new Promise((done) => { requestAnimationFrame(() => requestAnimationFrame(done)); });
  await Promise.all(world.panes.filter((p) => p.visible).map((p) => p.build()));
  performance.mark("plots in view");
  document.documentElement.dataset.state = "shown";
  const idle = window.requestIdleCallback ?? ((act) => setTimeout(act, 30));
  for (const pane of world.panes) {
    await new Promise((done) => { idle(done, { timeout: 500 }); });
    await pane.build();
  }
  document.documentElement.dataset.state = "complete";
}

start().catch((error) => {
  trouble(`The plots cannot be shown: ${error}`);
  throw error;
});
