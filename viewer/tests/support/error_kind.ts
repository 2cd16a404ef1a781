// The kind of error that an action throws.

import { UmbelError } from "../../packages/umbel/src/errors.js";

/** The kind of the UmbelError that an action throws; "none" if it throws nothing. */
export function kindOf(action: () => unknown): string {
  try {
    action();
  } catch (error) {
    if (error instanceof UmbelError) return error.kind;
    throw error;
  }
  return "none";
}
