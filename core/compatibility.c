/* What the loader compares: the size of each structure, and what the library was built from. */
#include "structures.h"

#define SIZE(s) {#s, sizeof(s)}

typedef struct {
    const char *name;
    int64_t size; /* bytes */
} structure;

static const structure SIZES[] = {
    SIZE(path), SIZE(linkage), SIZE(limits), SIZE(samples), SIZE(grip), SIZE(release),
    SIZE(move), SIZE(moved), SIZE(batch), SIZE(scene), SIZE(torques), SIZE(throw),
    SIZE(flown_sample), SIZE(reference), SIZE(extreme), SIZE(measured), SIZE(solid),
    SIZE(bodies), SIZE(contact),
};

EXPORT int64_t core_sizes(const structure **rows)
{
    *rows = SIZES;
    return sizeof SIZES / sizeof *SIZES;
}

/* A hash of the sources; setup.py gives it. */
#ifndef CORE_SOURCES
#define CORE_SOURCES ""
#endif

EXPORT const char *core_sources(void) { return CORE_SOURCES; }
