// A tab that is duplicated gets a copy of what the other one has stored: a lock tells them apart.

const PATIENCE_MS = 1000; // a page that follows another in the same tab gets the lock once that has gone

let release = null;

// Resolves with true once this tab has the lock of a name, with false if another tab has it.
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
