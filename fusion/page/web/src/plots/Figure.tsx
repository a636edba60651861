// A plot with its title and its files: SVG with the colours written in, PNG at twice the size.
import type { ComponentChildren } from "preact";
import { useRef } from "preact/hooks";
import { note, noteError, saveBlob } from "../api";
import { t } from "../words";

const WRITTEN_IN = [
  "fill", "fill-opacity", "stroke", "stroke-width", "stroke-dasharray", "stroke-linecap",
  "stroke-linejoin", "stroke-opacity", "opacity", "font-family", "font-size", "font-weight",
  "vector-effect", "paint-order",
] as const;

const PNG_WIDTH_PX = 1600;

function standalone(svg: SVGSVGElement): { text: string; width: number; height: number } {
  const copy = svg.cloneNode(true) as SVGSVGElement;
  const from = [svg, ...svg.querySelectorAll<SVGElement>("*")];
  const to = [copy, ...copy.querySelectorAll<SVGElement>("*")];
  from.forEach((one, i) => {
    const style = getComputedStyle(one);
    const place = to[i];
    for (const name of WRITTEN_IN) place?.setAttribute(name, style.getPropertyValue(name));
    place?.removeAttribute("class");
    place?.removeAttribute("tabindex");
  });
  const box = svg.getBoundingClientRect();
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  copy.setAttribute("width", `${box.width}`);
  copy.setAttribute("height", `${box.height}`);
  const ground = document.createElementNS("http://www.w3.org/2000/svg", "rect");
  const { x, y, width, height } = svg.viewBox.baseVal;
  for (const [name, value] of Object.entries({ x, y, width, height })) {
    ground.setAttribute(name, `${value}`);
  }
  ground.setAttribute("fill", getComputedStyle(document.body).getPropertyValue("--panel"));
  copy.prepend(ground);
  const text = new XMLSerializer().serializeToString(copy);
  return { text, width: box.width, height: box.height };
}

async function pngFrom(svg: SVGSVGElement): Promise<Blob> {
  const { text, width, height } = standalone(svg);
  const address = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
  try {
    const image = new Image();
    image.src = address;
    await image.decode();
    const canvas = document.createElement("canvas");
    canvas.width = PNG_WIDTH_PX;
    canvas.height = Math.round((PNG_WIDTH_PX * height) / width);
    canvas.getContext("2d")?.drawImage(image, 0, 0, canvas.width, canvas.height);
    return await new Promise((resolve, reject) =>
      canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error(t("error.png"))))),
    );
  } finally {
    URL.revokeObjectURL(address);
  }
}

export function Figure(props: {
  title: string;
  file: string;
  legend?: ComponentChildren;
  children: ComponentChildren;
}) {
  const ref = useRef<HTMLElement>(null);
  const save = async (kind: "svg" | "png") => {
    const svg = ref.current?.querySelector<SVGSVGElement>(".plot svg");
    if (!svg) return note("wrong", t("error.noPlot"));
    try {
      const blob =
        kind === "png"
          ? await pngFrom(svg)
          : new Blob([standalone(svg).text], { type: "image/svg+xml" });
      saveBlob(blob, `${props.file}.${kind}`);
    } catch (error) {
      noteError(error);
    }
  };
  return (
    <figure class="panel figure" ref={ref}>
      <figcaption>
        <h2>{props.title}</h2>
        <span class="files">
          {(["svg", "png"] as const).map((kind) => (
            <button
              key={kind}
              type="button"
              class="quiet"
              aria-label={t("session.save", { what: props.title, kind: kind.toUpperCase() })}
              onClick={() => void save(kind)}
            >
              {kind.toUpperCase()}
            </button>
          ))}
        </span>
      </figcaption>
      <div class="plot">{props.children}</div>
      {props.legend}
    </figure>
  );
}
