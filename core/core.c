/* The core's version. */
#include "core.h"

EXPORT int core_version(void) { return CORE_VERSION; }
