/* The page of mbm poll --http: the values of polled fields in JSON, and the page that shows them,
 * cli/page.html.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef PAGE_H
#define PAGE_H

#include "followed.h"
#include "http.h"

typedef struct page {
    followed *of;
    uint32_t round, intervalMs; /* of the last values; the program sets them */
    http http;
} page;

/* Begins to listen at an address that http_check has checked. Returns the port, or -1 with errno
 * set. http_wait and the functions after it do the rest. */
int page_listen(page *p, const char *address);

#endif
