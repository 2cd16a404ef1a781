// Errors of assets: a sentence for the user, and a kind for the program.

export type UmbelErrorKind =
  | "network" // the connection failed, or the server did
  | "missing" // there is nothing at the address
  | "refused" // the server does not give the file to this page
  | "not-umbel" // not an .umbel file
  | "version" // written by a newer major version
  | "corrupt" // an .umbel file, but its bytes contradict themselves
  | "memory" // the browser has no memory left
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

/** The error of an allocation that failed; undefined for other errors. */
export function memoryError(error: unknown): UmbelError | undefined {
  if (error instanceof UmbelError) return error.kind === "memory" ? error : undefined;
  // Browsers throw different errors. Reads beyond the end throw a RangeError, too.
  if (!(error instanceof Error && /memory|alloc/i.test(error.message))) return undefined;
  return new UmbelError(
    "memory",
    "The browser has no memory left for the asset. A smaller budget may help.",
  );
}

/** Checks an argument: a finite number of at least 0, or above 0 where `isPositive`. */
export function checkNumber(name: string, value: unknown, isPositive: boolean): void {
  const isValid = typeof value === "number" && Number.isFinite(value) && value >= 0;
  if (isValid && (value > 0 || !isPositive)) return;
  const range = isPositive ? "above 0" : "of at least 0";
  const given = typeof value === "string" ? JSON.stringify(value) : String(value);
  throw new RangeError(`\`${name}\` must be a finite number ${range}; it is ${given}.`);
}
