// A browser for tests, and pages in it that note what a user would never see.
import assert from 'node:assert/strict';
import { existsSync, mkdirSync } from 'node:fs';
import path from 'node:path';
import { project } from '../../../web/camera.js';
import { loadBrowser } from './packages.mjs';

const program = process.env.SPLATDRAG_BROWSER ?? '/usr/bin/chromium';

const shots = process.env.SPLATDRAG_SHOTS;
if (shots) mkdirSync(shots, { recursive: true });

/// Waits for a page end after so many milliseconds, in failure.
export const patience = 30_000;

/// Starts the browser; close() ends it.
export const launch = async () => {
  assert.ok(existsSync(program), `There is no browser at ${program}: install Debian's chromium, or name one in SPLATDRAG_BROWSER.`);
  const chromium = await loadBrowser();
  return chromium.launch({
    executablePath: program,
    args: ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync'],
  });
};

/// A new page of a service: {page, complaints, id}. `complaints`: errors in the console, requests to elsewhere.
///   context  more options of its context, such as hasTouch
export const openPage = async (browser, service, { viewport = { width: 1280, height: 800 }, ...context } = {}) => {
  const page = await (await browser.newContext({ viewport, acceptDownloads: true, ...context })).newPage();
  page.setDefaultTimeout(patience);
  const complaints = [];
  page.on('console', (message) => {
    const expected = /status of 401/.test(message.text());  // asked before signing in
    if (message.type() === 'error' && !expected) complaints.push(message.text());
  });
  page.on('pageerror', (error) => complaints.push(String(error)));
  page.on('request', (request) => {
    if (!request.url().startsWith(service.url.origin) && !/^(blob|data):/.test(request.url())) complaints.push(`went to ${request.url()}`);
  });
  await page.goto(service.url.href);
  return { page, complaints, id: (name) => page.getByTestId(name) };
};

/// Fingers on a page.
export const fingerOn = async (page) => {
  const session = await page.context().newCDPSession(page);
  const send = (type, points) => session.send('Input.dispatchTouchEvent', { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  const drop = () => send('touchEnd', []);
  return {
    drop,
    /// One goes down at the first place, along the others, and up.
    ///   last  may be {drop: false}: it stays down
    drag: async (...places) => {
      const { drop: lifts = true } = Array.isArray(places.at(-1)) ? {} : places.pop();
      await send('touchStart', [places[0]]);
      for (const place of places.slice(1)) await send('touchMove', [place]);
      if (lifts) await drop();
    },
    /// Several, each along its own places.
    together: async (...ways) => {
      await send('touchStart', ways.map(([first]) => first));
      for (let i = 1; i < ways[0].length; ++i) await send('touchMove', ways.map((way) => way[i]));
      await drop();
    },
  };
};

/// The hand on the picture of an open page.
export const handOn = ({ page, id }) => {
  const state = (wanted, timeout = 120_000) => page.waitForFunction((name) => {
    const bar = document.querySelector('[data-testid=thing-bar]');
    return !bar.hidden && bar.dataset.state === name;
  }, wanted, { timeout });
  /// Until the page knows how large its picture is: a window that was resized tells it with the next frame.
  const fitted = () => page.waitForFunction(() => {
    const [view, canvas] = ['view', 'picture'].map((name) => document.getElementById(name));
    return Math.abs(canvas.width / canvas.height - view.clientWidth / view.clientHeight) < 0.01;
  });
  /// The camera of the picture, and where that is on the screen.
  const looksFrom = async () => {
    // It saves a little later; at once where it might be left. What is three times the same has come to rest.
    await fitted();
    const saved = () => page.evaluate(() => {
      dispatchEvent(new Event('pagehide'));
      return localStorage.getItem(`splatdrag.scene.${location.hash.split('/').at(-1)}`);
    }).then((text) => JSON.parse(text).pose);
    let pose;
    for (let alike = 0; alike < 3;) {
      const next = await saved();
      alike = JSON.stringify(next) === JSON.stringify(pose) ? alike + 1 : 1;
      pose = next;
      if (alike < 3) await page.waitForTimeout(100);
    }
    const box = await id('view').boundingBox();
    return { camera: { ...pose, width: box.width, height: box.height }, box };
  };
  return {
    state,
    /// Until the picture on the screen is the full one of a version.
    shown: async (version) => {
      await fitted();
      await page.waitForFunction((wanted) => {
        const view = document.querySelector('[data-testid=view]');
        return view?.dataset.version === String(wanted) && view.dataset.quality === 'full';
      }, version, { timeout: patience });
    },
    /// Where a point of the world is on the screen, once the page has remembered where it looks from.
    onScreen: async (point) => {
      const { camera, box } = await looksFrom();
      const { x, y } = project(camera, point);
      return [box.x + x, box.y + y];
    },
    looksFrom,
    /// How many Gaussians are taken, once the page knows and the picture shows them.
    count: async () => Number(await (await page.waitForFunction(() => {
      const { count, waits } = document.querySelector('[data-testid=selection-count]').dataset;
      const { selection, quality } = document.querySelector('[data-testid=view]').dataset;
      return count > 0 && waits === undefined && selection && quality === 'full' && count;
    })).jsonValue()),
    drag: async (from, to, { drop = true } = {}) => {
      await page.mouse.move(...from);
      await page.mouse.down();
      await page.mouse.move(...to, { steps: 12 });
      if (drop) await page.mouse.up();
    },
    /// By keys alone: slides the view until a point is under the cross in its middle, as near as they come.
    aim: async (point) => {
      await id('view').focus();
      // What is nearer than the pivot moves by more than a step of the keys: it need not come to rest.
      for (let i = 0; i < 6; ++i) {
        const { camera } = await looksFrom();
        const { x, y } = project(camera, point);
        const away = [x - camera.width / 2, y - camera.height / 2].map((d) => Math.round(d / 30));
        if (away.every((n) => n === 0)) break;
        for (const [n, [more, less]] of [[away[0], ['Right', 'Left']], [away[1], ['Down', 'Up']]])
          for (let k = 0; k < Math.abs(n); ++k) await page.keyboard.press(`Shift+Arrow${n > 0 ? more : less}`);
      }
    },
    /// The mouse, as fingerOn() has a finger.
    mouse: {
      drop: () => page.mouse.up(),
      drag: async (...places) => {
        const { drop: lifts = true } = Array.isArray(places.at(-1)) ? {} : places.pop();
        await page.mouse.move(...places[0]);
        await page.mouse.down();
        for (const place of places.slice(1)) await page.mouse.move(...place, { steps: 4 });
        if (lifts) await page.mouse.up();
      },
    },
    shot: (name) => shots && page.screenshot({ path: path.join(shots, `${name}.png`) }),
  };
};
