import { readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";
import { describe, expect, it } from "vitest";
import de from "../src/words/de.json";
import en from "../src/words/en.json";

const holes = (text: string) => [...text.matchAll(/\{(\w+)\}/g)].map((hole) => hole[1]).sort();

function sources(folder: string): string[] {
  return readdirSync(folder, { withFileTypes: true }).flatMap((one) => {
    const path = join(folder, one.name);
    if (one.isDirectory()) return sources(path);
    return /\.tsx?$/.test(one.name) ? [readFileSync(path, "utf8")] : [];
  });
}

describe("words", () => {
  it("both languages have the same keys", () => {
    expect(Object.keys(de).sort()).toEqual(Object.keys(en).sort());
  });
  it("and the same holes to fill", () => {
    for (const [key, text] of Object.entries(en)) {
      expect(holes((de as Record<string, string>)[key] ?? ""), key).toEqual(holes(text));
    }
  });
  it("none is empty, and none is left over", () => {
    const text = sources(join(import.meta.dirname, "../src")).join("\n");
    const groups = [...text.matchAll(/`(\w+(?:\.\w+)?)\.\$\{/g)].map((found) => `${found[1]}.`);
    groups.push(...[...text.matchAll(/named\("(\w+)"/g)].map((found) => `${found[1]}.`));
    for (const [key, words] of Object.entries(en)) {
      expect(words.trim(), key).not.toBe("");
      const is_used = text.includes(`"${key}"`) || groups.some((group) => key.startsWith(group));
      expect(is_used, `${key} is used nowhere`).toBe(true);
    }
  });
});
