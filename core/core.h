/* What all files of the core share. */
#ifndef CORE_H
#define CORE_H

#include <math.h>
#include <stdint.h>

/* What Python calls. */
#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* A heavy function is compiled for plain x86-64 and for AVX2 with FMA, one of many lanes for AVX-512
   as well; the loader takes what the processor has. What it calls is compiled with it if it is
   INLINE. The address sanitizer starts later than what the loader takes. */
#if defined __x86_64__ && defined __GLIBC__ && !defined __clang__ && __GNUC__ >= 12 \
    && !defined __SANITIZE_ADDRESS__
#define CLONES __attribute__((target_clones("default", "arch=x86-64-v3")))
#define WIDE_CLONES __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define CLONES
#define WIDE_CLONES
#endif
#if defined __GNUC__
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif

/* hypot takes longer, against overflow; glibc's newest one would bind Linux wheels to glibc 2.35. */
INLINE double length(double x, double y) { return sqrt(x * x + y * y); }

#endif
