// Opens assets as meshes, and reports what of them is not shown and whether their connections are lost.

import { AssetStream } from "umbel";
import { UmbelMesh } from "umbel/three";
import type { Source, State } from "./state";
import type { Notice } from "./ui/messages";
import type { Panel } from "./ui/panel";
import { LOST } from "./ui/texts";
import type { Meshes } from "./viewport/viewport";

/** What notices about failures that may pass are about. */
const MEMORY = "memory";

export class AssetLoader {
  /** The meshes that are shown. */
  private meshes: Meshes = [undefined, undefined];
  /** What of them is not shown. */
  private notes = new Set<string>();
  /** Those whose connection is lost. */
  private readonly lost = new Map<UmbelMesh, Source>();

  constructor(
    private readonly state: State,
    private readonly panel: Panel,
    private readonly notice: Notice,
  ) {}

  /** @param early a stream of the asset that is open or opening already */
  async load(source: Source, pixelError: number, early?: Promise<AssetStream>): Promise<UmbelMesh> {
    const stream = await (early ?? this.open(source));
    const mesh = new UmbelMesh(stream, { pixelError });
    // It may have been changed in the meantime.
    if (stream.budget !== this.state.budget) mesh.setBudget(this.state.budget);
    mesh.materials.onNote = () => this.showNotes();
    mesh.onError = (error) => this.notice.keep(MEMORY, error.message);
    mesh.onConnection = (isLost) => {
      const before = this.lost.size;
      if (isLost) this.lost.set(mesh, source);
      else this.lost.delete(mesh);
      this.showLost();
      if (this.lost.size === 0 && before > 0) this.notice.show("The connection is back.");
    };
    return mesh;
  }

  private async open(source: Source): Promise<AssetStream> {
    // Another asset may be opened before this one is.
    const opening = {};
    try {
      return await AssetStream.open(source, { budget: this.state.budget }, (isLost) =>
        this.notice.keep(opening, isLost ? LOST : undefined),
      );
    } finally {
      this.notice.keep(opening, undefined);
    }
  }

  /** Reports on these meshes from now on, and no longer on those before. */
  setMeshes(meshes: Meshes): void {
    for (const mesh of this.meshes)
      if (mesh && !meshes.includes(mesh)) this.notice.keep(mesh, undefined);
    if (meshes[0] !== this.meshes[0]) this.notes.clear();
    this.meshes = [...meshes];
    for (const mesh of this.lost.keys()) if (!meshes.includes(mesh)) this.lost.delete(mesh);
    this.showLost();
    this.showNotes();
  }

  /** To be called with each frame. */
  update(): void {
    if (this.meshes.every((mesh) => mesh?.isCutSettled ?? true))
      this.notice.keep(MEMORY, undefined);
  }

  private showLost(): void {
    const isLocal = [...this.lost.values()].every((source) => typeof source !== "string");
    const text = isLocal
      ? "The file can no longer be read: was it moved or changed? Open it again."
      : LOST;
    this.notice.keep(this, this.lost.size > 0 ? text : undefined);
  }

  /** Lists what is not shown in the panel, and reports what is new. */
  private showNotes(): void {
    const notes = new Set(this.meshes.flatMap((mesh) => mesh?.materials.notes ?? []));
    for (const text of notes) if (!this.notes.has(text)) this.notice.show(text);
    this.notes = notes;
    this.panel.setNotes([...notes]);
  }
}
