// A limit on the memory of a service, as a container has it.
import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, readFileSync, rmdirSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { atEnd } from './program.mjs';

/// A control group of its own, where this user may make one and the limit holds in it.
const group = (bytes) => {
  for (const [parent, limit, peak] of [['/sys/fs/cgroup', 'memory.max', 'memory.peak'], ['/sys/fs/cgroup/memory', 'memory.limit_in_bytes', 'memory.max_usage_in_bytes']]) {
    const folder = path.join(parent, `splatdrag-test-${process.pid}`);
    try {
      mkdirSync(folder);
      atEnd(() => { try { rmdirSync(folder); } catch { /* who is still in it ends with this process */ } });
      if (!existsSync(path.join(folder, limit))) continue;
      writeFileSync(path.join(folder, limit), `${bytes}`);
      const join = ['sh', '-c', `echo $$ > ${folder}/cgroup.procs && exec "$@"`, 'sh'];
      execFileSync(join[0], [...join.slice(1), 'true']);
      const read = () => existsSync(path.join(folder, peak)) ? Number(readFileSync(path.join(folder, peak), 'utf8')) : NaN;
      return { kind: 'a control group', within: join, peak: read };
    } catch { /* another kind, or none */ }
  }
  return null;
};

/// Within such a limit: {kind, within, peak()}; `within` is for Service.start(), `peak` what the group has taken at most, in
/// bytes. Where no control group is to be had, the limit is one of addresses, of which a process takes more than of memory.
export const confined = (bytes) =>
  group(bytes) ?? { kind: 'a limit of addresses', within: ['prlimit', `--as=${bytes}`], peak: () => NaN };
