// Measures the page on the fox, in Debian's chromium, and writes docs/page-latency.md:
//   - from a move of the mouse to the new picture, while a part of about 30,000 Gaussians is dragged;
//   - interactive renders (orbiting, in the page's own sizes) while an edit runs;
//   - pictures a second while the view turns, at 640x480, with 150 ms of network between and without;
//   - the first picture of a scene that the service has loaded; a stop, a cancel, and a service that falls silent.
// Wants the machine to itself. The figures are of this machine: the file says which.
//
//   node tests/service/page_latency.mjs [--moves 100] [--renders 300] [--times 10] [--out docs/page-latency.md]
import { writeFile } from 'node:fs/promises';
import os from 'node:os';
import path from 'node:path';
import { parseArgs } from 'node:util';
import { handOn, launch, openPage } from './support/browser.mjs';
import { root, Service, temporaryFolder } from './support/program.mjs';
import { datasetZip, fox } from './support/scenes.mjs';

const { values } = parseArgs({ options: { moves: { type: 'string', default: '100' }, renders: { type: 'string', default: '300' }, times: { type: 'string', default: '10' }, out: { type: 'string', default: path.join(root, 'docs/page-latency.md') } } });
const [moves, renders, again] = [Number(values.moves), Number(values.renders), Number(values.times)];
const given = `--moves ${moves} --renders ${renders} --times ${again}`;
const wanted = 30_000;

const capture = fox();
if (capture.absent) throw new Error(capture.absent);
const load = os.loadavg()[0];

const quantile = (times, q) => [...times].sort((a, b) => a - b)[Math.min(times.length - 1, Math.floor(q * times.length))];
const row = (what, times) => `| ${what} | ${times.length} | ${quantile(times, 0.5).toFixed(0)} | ${quantile(times, 0.95).toFixed(0)} | ${Math.max(...times).toFixed(0)} |`;

const service = await Service.start();
const browser = await launch();
try {
  const { client } = service;
  const scene = (await client.upload(capture.ply, { name: 'fox' })).id;
  await client.putDataset(scene, await datasetZip(capture.folder));

  // The part: a sphere about the fox's head that holds about as many as wanted.
  const [{ source }] = capture.drags.ear_up.handles;
  const held = async (radius) => (await client.post(`/v1/scenes/${scene}/versions/0/select`, { selection: [{ sphere: { center: source, radius } }] })).json().count;
  let [low, high] = [0.01, 100];
  for (let i = 0; i < 30; ++i) {
    const middle = Math.sqrt(low * high);
    if (await held(middle) < wanted) low = middle; else high = middle;
  }
  const selection = [{ sphere: { center: source, radius: high } }];
  const count = await held(high);

  const { page, id } = await openPage(browser, service, { viewport: { width: 1366, height: 768 } });
  const hand = handOn({ page, id });
  await id(`scene-${scene}`).getByTestId('scene-open').click();
  await hand.shown(0);
  const request = path.join(temporaryFolder(), 'part.json');
  await writeFile(request, JSON.stringify({ handles: [{ source }], selection }));
  await id('import-file').setInputFiles(request);
  await id('auto-repair').uncheck();
  await hand.count();
  const at = await hand.onScreen(source);

  // One move, its picture, the next move: what the hand waits for.
  await page.evaluate(() => {
    const view = document.querySelector('[data-testid=view]');
    window.latencies = [];
    let moved = null;
    let version = null;
    addEventListener('pointermove', () => (moved ??= performance.now()), true);
    view.addEventListener('shown', ({ detail }) => {
      if (moved === null || detail.version === version || !/^p/.test(detail.version)) return;
      version = detail.version;
      // It is on the screen with the next frame.
      const since = moved;
      requestAnimationFrame(() => {
        window.latencies.push(performance.now() - since);
        moved = null;
      });
    });
  });
  await page.mouse.move(...at);
  await page.mouse.down();
  for (let i = 1; i <= moves; ++i) {
    await page.evaluate(() => { window.seen = window.latencies.length; });
    await page.mouse.move(at[0] + 6 + 40 * Math.sin(i / 8), at[1] - 20 * Math.sin(i / 13) - 6);
    await page.waitForFunction(() => window.latencies.length > window.seen, null, { polling: 4 });
  }
  await page.mouse.up();
  const drags = (await page.evaluate(() => window.latencies)).slice(5);  // the first ones find out what the later ones know
  await page.keyboard.press('Escape');
  await id('thing-drop').click();

  // Renders while an edit runs: as many as the page asks for while it is orbited.
  const times = [];
  page.on('requestfinished', (asked) => {
    if (!/\/render$/.test(asked.url())) return;
    const { requestStart, responseEnd } = asked.timing();
    times.push(responseEnd - requestStart);
  });
  const edit = () => client.submit({ scene, version: 0, preset: 'draft', handles: capture.drags.ear_up.handles, params: { intervals: 8 } });
  let running = (await edit()).id;
  await client.until(running, ({ state }) => state === 'running');
  const box = await id('view').boundingBox();
  const [x, y] = [box.x + 0.9 * box.width, box.y + 0.1 * box.height];
  await page.mouse.move(x, y);
  await page.mouse.down();
  times.length = 0;
  for (let i = 0; times.length < renders; ++i) {
    await page.mouse.move(x - 60 - 60 * Math.sin(i / 20), y + 20 * Math.sin(i / 15));
    if (i % 20 === 0 && (await client.edit(running)).ended) {
      running = (await edit()).id;
      await client.until(running, ({ state }) => state === 'running');
    }
  }
  await page.mouse.up();
  await client.post(`/v1/edits/${running}/cancel`);
  await client.ended(running);

  // A scene that is loaded is opened: from the press to the first picture on the screen.
  const opened = [];
  for (let i = 0; i < again; ++i) {
    await id('home-link').click();
    await id(`scene-${scene}`).waitFor();
    opened.push(await page.evaluate(async (name) => {
      const link = document.querySelector(`[data-testid=scene-${name}] [data-testid=scene-open]`);
      const shown = new Promise((done) => document.querySelector('[data-testid=view]').addEventListener('shown', done, { once: true }));
      const since = performance.now();
      link.click();
      await shown;
      await new Promise((done) => requestAnimationFrame(done));
      return performance.now() - since;
    }, scene));
  }

  // Stop and cancel, from the press to the state that the page shows. Each stop is pressed early in an interval.
  const stops = [], cancels = [];
  const pressed = async (testid, ...more) => {
    const since = performance.now();
    await id(running).getByTestId(testid).click();
    for (const next of more) await id(next).click();
    await page.waitForFunction((name) => /succeeded|cancelled/.test(document.querySelector(`[data-testid=${name}]`).dataset.state), running, { polling: 10 });
    return performance.now() - since;
  };
  await id('tab-button-edits').click();
  for (let i = 0; i < again; ++i)
    for (const [testid, times, ...more] of [['edit-stop', stops], ['edit-cancel', cancels, 'confirm-yes']]) {
      const params = { intervals: 20, iterations: 400, views: 12, max_image_side: 320 };
      const { id: name } = await client.submit({ scene, version: 0, preset: 'draft', handles: capture.drags.ear_up.handles, params });
      running = `edit-${name}`;
      await id(running).and(page.locator('[data-state=running]')).waitFor();
      await client.until(name, (edit) => edit.finished_intervals.length >= 1 && edit.iteration > 0);
      times.push(await pressed(testid, ...more));
    }

  // Nothing is heard of the service any more: until the page says so, and until it goes on.
  const silent = [], back = [];
  for (let i = 0; i < 5; ++i) {
    await page.waitForTimeout(1500);
    for (const [signal, state, times] of [['SIGSTOP', 'visible', silent], ['SIGCONT', 'hidden', back]]) {
      const since = performance.now();
      service.process.kill(signal);
      await id('away').waitFor({ state });
      times.push(performance.now() - since);
    }
  }
  await page.context().close();

  // Turning the view without an end, in a window whose picture is 640x480.
  const turning = [];
  for (const latency of [0, 150]) {
    const { page: small, id: inSmall } = await openPage(browser, service, { viewport: { width: 1100, height: 700 } });
    await inSmall(`scene-${scene}`).getByTestId('scene-open').click();
    await small.waitForFunction(() => document.querySelector('[data-testid=view]')?.dataset.quality === 'full');
    await inSmall('version-select').selectOption('0');
    await handOn({ page: small, id: inSmall }).shown(0);
    await small.evaluate(() => {
      const view = document.querySelector('[data-testid=view]');
      Object.assign(view.style, { flex: 'none', width: '640px', height: '480px' });
      window.sizes = [];
      view.addEventListener('shown', ({ detail }) => window.sizes.push([detail.size.width, detail.size.height]));
    });
    const network = await small.context().newCDPSession(small);
    await network.send('Network.emulateNetworkConditions', { offline: false, latency, downloadThroughput: -1, uploadThroughput: -1 });
    const place = await inSmall('view').boundingBox();
    const [cx, cy] = [place.x + 0.9 * place.width, place.y + 0.15 * place.height];
    await small.mouse.move(cx, cy);
    await small.mouse.down();
    const turn = async (seconds) => {
      await small.evaluate(() => { window.sizes = []; });
      const since = performance.now();
      for (let i = 0; performance.now() - since < 1000 * seconds; ++i) {
        await small.mouse.move(cx - 100 + 100 * Math.cos(i / 60), cy);
        await small.waitForTimeout(8);
      }
      return small.evaluate(() => window.sizes);
    };
    await turn(3); // The size settles.
    const sizes = await turn(8);
    await small.mouse.up();
    const wide = quantile(sizes.map(([width]) => width), 0.5);
    const high = sizes.find(([width]) => width === wide)[1];
    turning.push(`| turning the view, picture of 640 × 480${latency ? `, ${latency} ms of network` : ''} | ${(sizes.length / 8).toFixed(1)} | ${wide} × ${high} |`);
    await small.context().close();
  }

  const text = `# How soon the page answers

Made by \`node tests/service/page_latency.mjs ${given}\`
on ${os.cpus().length} cores of ${os.cpus()[0].model.trim()} (load average before: ${load.toFixed(1)}),
chromium ${browser.version()} on the same machine,
a window of 1366x768. The fox: 62,298 Gaussians. Milliseconds.

| what | times | median | 95 % | longest |
| --- | ---: | ---: | ---: | ---: |
${row(`from a move of the mouse to the new picture, dragging ${count.toLocaleString('en-US')} Gaussians`, drags)}
${row('an interactive render, as the page waits for it, while an edit (`draft`) runs', times)}
${row('from the press that opens a loaded scene to its first picture', opened)}
${row('from *Stop and keep* to its result, the last finished interval', stops)}
${row('from *Cancel* to its end, the question whether one is sure included', cancels)}
${row('from the last sign of life to the message that the service does not answer', silent)}
${row('from its return to the end of that message', back)}

| what | pictures a second | pixels (median) |
| --- | ---: | ---: |
${turning.join('\n')}

The aims are a median below 100 ms for the first, and 95 % below 250 ms for the second; a first picture, a stop and a cancel
within a second, silence told within three; and 30 pictures a second. \`--out\` writes elsewhere.
`;
  await writeFile(values.out, text);
  console.log(text);
} finally {
  await browser.close();
  await service.stop();
}
