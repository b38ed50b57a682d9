// A browser for tests, and pages in it that note what a user would never see.
import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import { loadBrowser } from './packages.mjs';

const program = process.env.SPLATDRAG_BROWSER ?? '/usr/bin/chromium';

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
