// Starts the real program, and ends it.
import assert from 'node:assert/strict';
import { execFile, spawn } from 'node:child_process';
import { existsSync, mkdtempSync, rmSync } from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { promisify } from 'node:util';
import { Client } from './client.mjs';

export const root = fileURLToPath(new URL('../../..', import.meta.url));
export const program = process.env.SPLATDRAG_PROGRAM ?? path.join(root, 'build/release/splatdrag');
assert.ok(existsSync(program), `There is no program at ${program}: build it, or name it in SPLATDRAG_PROGRAM.`);

// The program's own variables must not leak into tests (SPLATDRAG_PORT, SPLATDRAG_TOKEN_FILE, ...).
export const environment = Object.fromEntries(Object.entries(process.env).filter(([name]) => !name.startsWith('SPLATDRAG_')));

/// Runs the program to its end: {stdout, stderr}.
export const run = (...args) => promisify(execFile)(program, args, { env: environment, maxBuffer: 1 << 26 });

const cleanups = [];
process.on('exit', () => {
  for (const cleanup of cleanups.reverse()) cleanup();
});
/// Does something when the tests end, before what was asked for earlier.
export const atEnd = (cleanup) => cleanups.push(cleanup);

/// A new empty folder, removed when the tests end.
export const temporaryFolder = (parent = os.tmpdir()) => {
  const folder = mkdtempSync(path.join(parent, 'splatdrag-test-'));
  atEnd(() => rmSync(folder, { recursive: true, force: true }));
  return folder;
};

/// A running service.
export class Service {
  /// Starts it and waits until it answers.
  ///   dataDir  kept between starts; a new one by default
  ///   args     more options
  ///   within   a command that starts it, and what belongs to that: ['prlimit', '--as=2147483648']
  static async start({ dataDir = temporaryFolder(), args = [], token, within = [] } = {}) {
    const service = new Service();
    Object.assign(service, { dataDir, args, token, within });
    await service.#spawn();
    return service;
  }

  async #spawn() {
    const args = ['serve', '--host', '127.0.0.1', '--port', `${this.port ?? 0}`, '--data-dir', this.dataDir, ...this.args];
    const [command, ...rest] = [...this.within, program, ...args];
    this.process = spawn(command, rest, { env: environment, stdio: ['ignore', 'pipe', 'pipe'] });
    const child = this.process;
    atEnd(() => child.kill('SIGKILL'));
    this.log = '';
    this.exited = new Promise((done) => child.on('exit', (code, signal) => done({ code, signal })));
    const url = await new Promise((done, failed) => {
      const timer = setTimeout(() => failed(new Error(`the service did not start in two minutes:\n${this.log}`)), 120_000);
      const listen = (chunk) => {
        this.log = (this.log + chunk).slice(-1_000_000);
        const match = /listening on (http:\/\/[^\s"]+)/.exec(this.log);
        if (match) {
          clearTimeout(timer);
          done(match[1]);
        }
      };
      child.stdout.on('data', listen);
      child.stderr.on('data', listen);
      this.exited.then(({ code, signal }) => {
        clearTimeout(timer);
        failed(new Error(`the service ended (${code ?? signal}) before it listened:\n${this.log}`));
      });
    });
    this.url = new URL(url);
    this.client?.close();
    this.client = new Client(url, { token: this.token });
  }

  /// As a service manager ends it. It must go in peace.
  async stop() {
    this.client.close();
    this.process.kill('SIGTERM');
    const timer = setTimeout(() => this.process.kill('SIGKILL'), 20_000);
    const { code, signal } = await this.exited;
    clearTimeout(timer);
    assert.equal(code, 0, `the service ended with ${code ?? signal}:\n${this.log.slice(-5000)}`);
  }

  /// As a power cut ends it.
  async kill() {
    this.client.close();
    this.process.kill('SIGKILL');
    await this.exited;
  }

  /// Starts it again on the same data.
  ///   there  at the same address, where somebody waits for it
  start({ there = false } = {}) {
    if (there) this.port = this.url.port;
    return this.#spawn();
  }

  /// Fails unless it lives and answers.
  async alive() {
    assert.equal(this.process.exitCode, null, `the service ended:\n${this.log.slice(-5000)}`);
    await this.client.get('/healthz');
    await this.client.get('/readyz');
  }
}
