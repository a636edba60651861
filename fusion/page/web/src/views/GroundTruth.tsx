// Clips of which a person says where the ball is. The tool itself is a page of its own (../label): one
// picture, and a key for everything.
import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { address, get, noteError } from "../api";
import type { Clip } from "../contract";
import { sizeText } from "../pure/units";
import { dayText, t } from "../words";

const clips = signal<Clip[]>([]);

async function loadClips(): Promise<void> {
  try {
    clips.value = (await get<{ clips: Clip[] }>("/clips")).clips;
  } catch (error) {
    noteError(error);
  }
}

export function GroundTruth() {
  useEffect(() => void loadClips(), []);
  return (
    <section class="panel ground-truth">
      <h2>{t("truth.title")}</h2>
      <p>{t("truth.about")}</p>
      {clips.value.length === 0 ? (
        <p class="quiet-text">{t("truth.none")}</p>
      ) : (
        <ul class="files-list">
          {clips.value.map((clip) => (
            <li key={clip.name}>
              <a href={`/label/#clip=${encodeURIComponent(clip.name)}`}>
                {t("truth.label", { clip: clip.name })}
              </a>
              <span class="quiet-text">{sizeText(clip.bytes)} · {dayText(clip.at_ms)}</span>
              {clip.is_labelled && (
                <a href={address(`/clips/${encodeURIComponent(clip.name)}/labels.csv`)} download>
                  {t("truth.csv")}
                </a>
              )}
            </li>
          ))}
        </ul>
      )}
      <p class="quiet-text"><code>{t("truth.how")}</code></p>
    </section>
  );
}
