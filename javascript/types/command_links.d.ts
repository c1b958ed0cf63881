export const LINKS: Record<string, [string, string]>;
