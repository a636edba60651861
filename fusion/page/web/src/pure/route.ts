// The part of the address after '#' -> which view, and a token that came along.
export const VIEWS = ["live", "session", "drill", "setup", "settings"] as const;
export type View = (typeof VIEWS)[number];

export interface Route {
  view: View;
  token: string | null;
}

export function routeFrom(hash: string): Route {
  const text = hash.replace(/^#/, "");
  const token = new URLSearchParams(text).get("token");
  const name = text.replace(/^\//, "").split(/[/?]/)[0];
  const view = VIEWS.find((one) => one === name) ?? "live";
  return { view, token: token !== null && /^[\x21-\x7e]{1,256}$/.test(token) ? token : null };
}
