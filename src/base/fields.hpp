#pragma once
// Work on fields of structs by their names. Macros, since C++20 cannot list a struct's fields.

/// COPY_FIELDS(to, from, nodes, leaves): to.nodes = from.nodes; to.leaves = from.leaves.
#define COPY_FIELDS(to, from, ...) UMBEL_EACH_FIELD(UMBEL_COPY_FIELD, to, from, __VA_ARGS__)
#define UMBEL_COPY_FIELD(to, from, field) (to).field = (from).field

/// Expands to action(a, b, field); for each field, of which there may be 60.
#define UMBEL_EACH_FIELD(action, a, b, ...) \
  UMBEL_FIELDS_64(UMBEL_NEXT_FIELD(action, a, b, __VA_ARGS__)) static_assert(true)
#define UMBEL_NEXT_FIELD(action, a, b, field, ...) \
  action(a, b, field);                             \
  __VA_OPT__(UMBEL_NEXT_FIELD_LATER UMBEL_PARENTHESES(action, a, b, __VA_ARGS__))
// An own name is not expanded within its expansion: a later scan of the text does it.
#define UMBEL_NEXT_FIELD_LATER() UMBEL_NEXT_FIELD
#define UMBEL_PARENTHESES ()
#define UMBEL_FIELDS_64(...) \
  UMBEL_FIELDS_16(UMBEL_FIELDS_16(UMBEL_FIELDS_16(UMBEL_FIELDS_16(__VA_ARGS__))))
#define UMBEL_FIELDS_16(...) \
  UMBEL_FIELDS_4(UMBEL_FIELDS_4(UMBEL_FIELDS_4(UMBEL_FIELDS_4(__VA_ARGS__))))
#define UMBEL_FIELDS_4(...) __VA_ARGS__
