// Distinguishes a duplicated browser tab from its original. Both have the same session storage, but only one tab can
// hold a lock.

const PATIENCE_MS = 5000; // maximum wait until the previous page in the same tab has released the lock; the lease lasts longer

/** @type {((nothing: void) => void) | null} */
let release = null;

// The promise resolves with true once this tab holds the lock `name`, and with false if another tab holds it.
/** @type {(name: string) => Promise<boolean>} */
export function lockForThisTab(name) {
  unlock();
  const ending = new AbortController();
  const patience = setTimeout(() => ending.abort(), PATIENCE_MS);
  return new Promise((resolve) => {
    const hold = () => {
      clearTimeout(patience);
      resolve(true);
      return new Promise((/** @type {(nothing: void) => void} */ end) => (release = end));
    };
    navigator.locks.request(name, { signal: ending.signal }, hold).catch(() => resolve(false));
  });
}

export function unlock() {
  release?.();
  release = null;
}
