// The system under test: a page's server that is started here, so that it can also be killed, beside
// a fusion and a simulated machine that scripts/test-page has started.
//
// PAGE_COMMAND: the server as a JSON list; DEMO_URL: the page of `demo`, with its token.
import { test as base, expect, type Page, type TestInfo } from "@playwright/test";
import { spawn, type ChildProcess } from "node:child_process";
import { copyFileSync, mkdirSync } from "node:fs";
import { join } from "node:path";

export { expect };

const ROOT = join(import.meta.dirname, "../..");
const ARTEFACTS = process.env["ARTEFACTS"] ?? join(ROOT, "tests/artefacts/page");
const PICTURES = join(ROOT, "tests/pictures");

export interface Ball {
  id: number;
  at_ms: number;
  /** How long after its bounce it was told; null when it was recorded. */
  age_ms: number | null;
  outcome: string;
  sentence: string | null;
  shot: { shot_idx?: number; bounce: { t_ns: number } | null };
}

export class Server {
  url = "";
  token = "";
  private child: ChildProcess | null = null;

  constructor(private readonly command: string[]) {}

  async start(): Promise<void> {
    const [program, ...flags] = this.command;
    if (program === undefined) throw new Error("PAGE_COMMAND is empty");
    // The mock keeps nothing; its ids must go on after a restart all the same.
    const env = { ...process.env, ...(this.url === "" ? {} : { MOCK_BALLS: "300" }) };
    const child = spawn(program, flags, { stdio: ["ignore", "pipe", "pipe"], env });
    this.child = child;
    let said = "";
    const address = await new Promise<string>((resolve, reject) => {
      const hear = (part: Buffer) => {
        said += part.toString();
        const found = /(http:\/\/\S+?)\/?#token=(\S+)/.exec(said);
        if (found) resolve(found[0]);
      };
      child.stdout?.on("data", hear);
      child.stderr?.on("data", hear);
      child.once("exit", (code) => reject(new Error(`${program} ended with ${code}: ${said}`)));
    });
    const [url = "", token = ""] = address.split(/\/?#token=/);
    this.url = url;
    this.token = token;
  }

  /** As a power cut would. */
  async kill(): Promise<void> {
    const child = this.child;
    this.child = null;
    if (!child || child.exitCode !== null) return;
    child.removeAllListeners("exit");
    const gone = new Promise((resolve) => child.once("exit", resolve));
    child.kill("SIGKILL");
    await gone;
  }

  api(path: string): string {
    return `${this.url}/api/v1${path}`;
  }

  async ask<T>(path: string): Promise<T> {
    const answer = await fetch(this.api(path));
    expect(answer.status, path).toBe(200);
    return (await answer.json()) as T;
  }

  async tell(method: string, path: string, body?: unknown): Promise<Response> {
    return fetch(this.api(path), {
      method,
      headers: { Authorization: `Bearer ${this.token}`, "Content-Type": "application/json" },
      ...(body === undefined ? {} : { body: JSON.stringify(body) }),
    });
  }

  /** Balls fly: with a drill, as a coach would have it. */
  async serve(): Promise<void> {
    const status = await this.ask<{ drill: { running: boolean } }>("/status");
    if (!status.drill.running) {
      const { drills } = await this.ask<{ drills: { name: string }[] }>("/drills");
      const order = { name: drills[0]?.name, is_correcting: true, balls: null };
      const answer = await this.tell("POST", "/drill/start", order);
      expect(answer.status, await answer.text()).toBe(200);
    }
  }

  async rest(): Promise<void> {
    await this.tell("POST", "/drill/stop");
  }

  async nBalls(): Promise<number> {
    return (await this.ask<{ balls: Ball[] }>("/balls?limit=500")).balls.length;
  }
}

export const test = base.extend<
  { open: (view?: string, options?: { token?: boolean }) => Promise<Page> },
  { server: Server }
>({
  server: [
    async ({}, use) => {
      const command = JSON.parse(process.env["PAGE_COMMAND"] ?? "[]") as string[];
      const server = new Server(command);
      await server.start();
      await use(server);
      await server.kill();
    },
    { scope: "worker" },
  ],
  open: async ({ page, server }, use) => {
    const wrong: string[] = [];
    page.on("pageerror", (error) => wrong.push(error.message));
    page.on("console", (message) => {
      // What is refused on purpose and a server that is gone are said there too.
      const is_net = /Failed to load resource|WebSocket connection/.test(message.text());
      if (message.type() === "error" && !is_net) wrong.push(message.text());
    });
    page.on("request", (request) => {
      const is_ours = request.url().startsWith(server.url) || /^(blob|data):/.test(request.url());
      if (!is_ours) wrong.push(`asked elsewhere: ${request.url()}`);
    });
    await use(async (view = "live", { token = true } = {}) => {
      if (token) {
        await page.goto(`${server.url}/#token=${server.token}`);
        await expect(page.locator("main")).toBeVisible();
        expect(page.url()).not.toContain("token");
      }
      await page.goto(`${server.url}/#/${view}`);
      await expect(page.locator(`main[data-view="${view}"] h1`)).toBeAttached();
      await expect(page.locator(".line.open")).toBeVisible();
      return page;
    });
    expect(wrong, "errors in the page").toEqual([]);
  },
});

/** Kept as an artefact, and with UPDATE_PICTURES for the README too. */
export async function picture(page: Page, info: TestInfo, name: string, readme = false): Promise<void> {
  mkdirSync(ARTEFACTS, { recursive: true });
  const path = join(ARTEFACTS, `${name}.png`);
  await page.screenshot({ path, animations: "disabled" });
  await info.attach(name, { path });
  if (readme && process.env["UPDATE_PICTURES"] === "1") {
    copyFileSync(path, join(PICTURES, `page-${name}.png`));
  }
}

/** The newest ball this page knows. */
export async function newest(page: Page): Promise<number> {
  return Number((await page.locator("[data-newest]").getAttribute("data-newest")) ?? 0);
}

export const PHONE = { width: 390, height: 844 };
