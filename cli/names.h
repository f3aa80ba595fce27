/* What the name of a field becomes in topics, and in identifiers of C and Home Assistant. The
 * section "Names" of docs/device-file.md has the rule. */
#pragma once

/* The most levels of a name: a/b/c has three. */
enum { NAMES_LEVELS = 8 };

/* How many levels a name has. */
unsigned names_levels(const char *name);

/* Return the end of a name's topics, and its identifier, which has only a to z, 0 to 9 and _. The
 * identifier is empty if the name has no letter and no digit. The name is UTF-8. The caller frees
 * them; they are NULL without memory. */
char *names_topic(const char *name);
char *names_identifier(const char *name);
