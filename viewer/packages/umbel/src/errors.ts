// Errors of assets: a sentence for the user, and a kind for the program.

export type UmbelErrorKind =
  | "network" // the connection failed, or the server did
  | "missing" // there is nothing at the address
  | "refused" // the server does not give the file to this page
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
