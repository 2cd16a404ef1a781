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
    const stream = early ?? AssetStream.open(source, { budget: this.state.budget });
    const mesh = new UmbelMesh(await stream, { pixelError });
    mesh.materials.onNote = (text) => this.addNote(text);
    for (const text of mesh.materials.notes) this.addNote(text);
    mesh.onConnection = (isLost) => {
      if (isLost) this.notice.show("The connection is lost. Trying again …", true);
      else this.notice.show("The connection is back.");
    };
    return mesh;
  }

  /** Reports something that is not shown, once: as a notice and in the panel. */
  private addNote(text: string): void {
    if (this.notes.has(text)) return;
    this.notes.add(text);
    this.panel.setNotes([...this.notes]);
    this.notice.show(text);
  }
}
