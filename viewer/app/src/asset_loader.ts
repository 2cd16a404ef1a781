// Opens assets as meshes, and reports what is not shown of them.

import { AssetStream } from "umbel";
import { UmbelMesh } from "umbel/three";
import type { Source, State } from "./state";
import type { Notice } from "./ui/messages";
import type { Panel } from "./ui/panel";

export class AssetLoader {
  private readonly notes = new Set<string>();

  constructor(
    private readonly state: State,
    private readonly panel: Panel,
    private readonly notice: Notice,
  ) {}

  /** Forgets the reports so far. */
  clearNotes(): void {
    this.notes.clear();
    this.panel.setNotes([]);
  }

  /** @param early a stream of the asset that is open or opening already */
  async load(source: Source, pixelError: number, early?: Promise<AssetStream>): Promise<UmbelMesh> {
    const stream = await (early ?? AssetStream.open(source, { budget: this.state.budget }));
    const mesh = new UmbelMesh(stream, { pixelError });
    // It may have been changed in the meantime.
    if (stream.budget !== this.state.budget) mesh.setBudget(this.state.budget);
    mesh.materials.onNote = (text, holds) => this.setNote(text, holds);
    for (const text of mesh.materials.notes) this.setNote(text);
    mesh.onConnection = (isLost) => {
      if (isLost) this.notice.show("The connection is lost. Trying again …", true);
      else this.notice.show("The connection is back.");
    };
    return mesh;
  }

  /** Reports something that is not shown, once: as a notice and in the panel, while it `holds`. */
  private setNote(text: string, holds = true): void {
    if (this.notes.has(text) === holds) return;
    if (holds) {
      this.notes.add(text);
      this.notice.show(text);
    } else this.notes.delete(text);
    this.panel.setNotes([...this.notes]);
  }
}
