// What can go wrong with an asset, as sentences for people and as kinds for programs.

export type UmbelErrorKind =
  | "network" // the connection failed, or the server did
  | "missing" // there is nothing at the address
  | "not-umbel" // not an .umbel file
  | "version" // written by a newer major version
  | "corrupt" // an .umbel file, but its bytes contradict themselves
  | "unsupported"; // the browser lacks something

export class UmbelError extends Error {
  constructor(
    readonly kind: UmbelErrorKind,
    message: string,
  ) {
    super(message);
    this.name = "UmbelError";
  }
}

export function corrupt(message: string): never {
  throw new UmbelError("corrupt", message);
}
