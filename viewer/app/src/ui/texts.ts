// What both the page before the viewer and the viewer say.

/** While requests to a host fail. */
export const LOST = "The connection is lost. Trying again …";
