// A duplicated tab receives a copy of the session storage; a lock distinguishes the two tabs.

const PATIENCE_MS = 1000; // maximum wait until the previous page in the same tab has released the lock

let release = null;

// Resolves with true once this tab has the lock with this name, with false if another tab has it.
export function lockForThisTab(name) {
  unlock();
  const ending = new AbortController();
  const patience = setTimeout(() => ending.abort(), PATIENCE_MS);
  return new Promise((resolve) => {
    const hold = () => {
      clearTimeout(patience);
      resolve(true);
      return new Promise((end) => (release = end));
    };
    navigator.locks.request(name, { signal: ending.signal }, hold).catch(() => resolve(false));
  });
}

export function unlock() {
  release?.();
  release = null;
}
