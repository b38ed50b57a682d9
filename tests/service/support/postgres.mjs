// A PostgreSQL server of the tests' own, on a socket in a temporary folder.
import { execFileSync, spawn, spawnSync } from 'node:child_process';
import { chmodSync, existsSync } from 'node:fs';
import path from 'node:path';
import { setTimeout as sleep } from 'node:timers/promises';
import { atEnd, temporaryFolder } from './program.mjs';

const programs = '/usr/lib/postgresql/15/bin';  // Debian's
export const installed = existsSync(path.join(programs, 'initdb'));

/// It does not run as root: then as the user that its package makes.
const user = () => process.getuid() !== 0 ? {} :
  Object.fromEntries([['uid', '-u'], ['gid', '-g']].map(([name, option]) => [name, Number(execFileSync('id', [option, 'postgres']))]));

export class Postgres {
  static async start() {
    const server = new Postgres();
    server.folder = temporaryFolder();
    chmodSync(server.folder, 0o777);
    execFileSync(path.join(programs, 'initdb'), ['-D', server.data, '--no-sync', '-U', 'tests', '-E', 'UTF8', '--locale=C', '--wal-segsize=1', '-A', 'trust'], { ...user(), stdio: 'pipe' });
    await server.start();
    return server;
  }

  get data() { return path.join(this.folder, 'data'); }
  /// The password is not asked for, but must not be seen anywhere either.
  get address() { return `postgresql://tests:secret@/postgres?host=${this.folder}`; }

  async start() {
    this.process = spawn(path.join(programs, 'postgres'), ['-D', this.data, '-k', this.folder, '-c', 'listen_addresses=', '-c', 'fsync=off'], { ...user(), stdio: 'ignore' });
    const child = this.process;
    atEnd(() => child.kill('SIGQUIT'));
    this.exited = new Promise((done) => child.on('exit', done));
    for (let tries = 0; spawnSync(path.join(programs, 'pg_isready'), ['-h', this.folder, '-q']).status !== 0; ++tries) {
      if (tries > 600) throw new Error('the server does not start');
      await sleep(50);
    }
  }

  /// At once; the next start finds out what was committed.
  async crash() {
    this.process.kill('SIGQUIT');
    await this.exited;
  }
}
