/* What the loader compares: where each field of each structure is, and what the library was built from. */
#include <stddef.h>

#include "structures.h"

#define STRUCTURE(s) {#s, 0, sizeof(s)}
#define FIELD(s, f) {#s "." #f, offsetof(s, f), sizeof(((s *)0)->f)}

typedef struct {
    const char *name;
    int64_t offset, size; /* bytes */
} place;

static const place PLACES[] = {
    STRUCTURE(path), FIELD(path, n), FIELD(path, powers), FIELD(path, pieces), FIELD(path, held),
    FIELD(path, corners), FIELD(path, breaks), FIELD(path, curves), FIELD(path, kinks),
    STRUCTURE(linkage), FIELD(linkage, n), FIELD(linkage, arm), FIELD(linkage, frames),
    FIELD(linkage, x), FIELD(linkage, z), FIELD(linkage, theta), FIELD(linkage, sign),
    FIELD(linkage, along), FIELD(linkage, up), FIELD(linkage, link), FIELD(linkage, frame_along),
    FIELD(linkage, frame_up),
    STRUCTURE(limits), FIELD(limits, q_min), FIELD(limits, q_max), FIELD(limits, dq),
    FIELD(limits, ddq), FIELD(limits, jerk), FIELD(limits, slowing), FIELD(limits, slows),
    STRUCTURE(samples), FIELD(samples, rows), FIELD(samples, n), FIELD(samples, tick),
    FIELD(samples, q), FIELD(samples, dq), FIELD(samples, ddq),
    STRUCTURE(grip), FIELD(grip, opening), FIELD(grip, stretch),
    FIELD(grip, pieces), FIELD(grip, breaks), FIELD(grip, curves),
    STRUCTURE(release), FIELD(release, motion), FIELD(release, arm), FIELD(release, grip),
    FIELD(release, law), FIELD(release, angle), FIELD(release, delay), FIELD(release, turning),
    FIELD(release, paper),
    STRUCTURE(move), FIELD(move, n), FIELD(move, carry), FIELD(move, stages), FIELD(move, size),
    FIELD(move, errors), FIELD(move, surface), FIELD(move, throws),
    FIELD(move, unit), FIELD(move, before), FIELD(move, shortest), FIELD(move, longest),
    FIELD(move, gravity), FIELD(move, nearer), FIELD(move, goal),
    FIELD(move, aim), FIELD(move, off), FIELD(move, start), FIELD(move, rate),
    FIELD(move, acceleration), FIELD(move, opening), FIELD(move, low), FIELD(move, high),
    FIELD(move, u), FIELD(move, slope), FIELD(move, limits), FIELD(move, release),
    STRUCTURE(moved), FIELD(moved, sent), FIELD(moved, room), FIELD(moved, stages),
    FIELD(moved, size), FIELD(moved, corners), FIELD(moved, release_room), FIELD(moved, nodes),
    FIELD(moved, lost), FIELD(moved, u), FIELD(moved, breaks), FIELD(moved, cubics),
    FIELD(moved, times), FIELD(moved, curves), FIELD(moved, kinks), FIELD(moved, nodes_at),
    FIELD(moved, onset),
    STRUCTURE(batch), FIELD(batch, count), FIELD(batch, steps), FIELD(batch, pieces),
    FIELD(batch, rows), FIELD(batch, width), FIELD(batch, paper), FIELD(batch, gap),
    FIELD(batch, shares),
    FIELD(batch, grip), FIELD(batch, numbers), FIELD(batch, knots), FIELD(batch, curves),
    FIELD(batch, delays), FIELD(batch, drift), FIELD(batch, detach), FIELD(batch, lost),
    STRUCTURE(scene), FIELD(scene, gravity), FIELD(scene, behind), FIELD(scene, length), FIELD(scene, half_width),
    FIELD(scene, parts), FIELD(scene, outline),
    FIELD(scene, column_radius), FIELD(scene, column_height), FIELD(scene, palm_back),
    FIELD(scene, palm_front), FIELD(scene, palm_half_width), FIELD(scene, palm_clearance),
    FIELD(scene, tool_length), FIELD(scene, cup_x), FIELD(scene, cup_rim), FIELD(scene, cup_radius),
    FIELD(scene, cup_insertion), FIELD(scene, cup_speed),
    STRUCTURE(torques), FIELD(torques, mass), FIELD(torques, along), FIELD(torques, up),
    FIELD(torques, inertia), FIELD(torques, limit),
    STRUCTURE(throws), FIELD(throws, motion), FIELD(throws, arm), FIELD(throws, around),
    FIELD(throws, torques), FIELD(throws, bodies), FIELD(throws, tick), FIELD(throws, step),
    STRUCTURE(thrown), FIELD(thrown, mass), FIELD(thrown, inertia), FIELD(thrown, com_offset),
    FIELD(thrown, angle), FIELD(thrown, force), FIELD(thrown, torque), FIELD(thrown, behind),
    FIELD(thrown, opening), FIELD(thrown, detach), FIELD(thrown, flight), FIELD(thrown, cup_x),
    FIELD(thrown, start), FIELD(thrown, error),
    STRUCTURE(measured), FIELD(measured, grip), FIELD(measured, arm), FIELD(measured, held),
    FIELD(measured, column_held), FIELD(measured, column_flown), FIELD(measured, palm),
    FIELD(measured, speed), FIELD(measured, torque), FIELD(measured, palm_time), FIELD(measured, rate),
    FIELD(measured, cup),
    STRUCTURE(solid), FIELD(solid, centre), FIELD(solid, axes), FIELD(solid, half),
    FIELD(solid, radius), FIELD(solid, clearance), FIELD(solid, bar),
    STRUCTURE(bodies), FIELD(bodies, links), FIELD(bodies, bar), FIELD(bodies, moved_by),
    FIELD(bodies, moves), FIELD(bodies, places), FIELD(bodies, radius),
    FIELD(bodies, outline),
    FIELD(bodies, solids), FIELD(bodies, around), FIELD(bodies, pairs), FIELD(bodies, always),
    FIELD(bodies, meet), FIELD(bodies, apart),
    FIELD(bodies, behind), FIELD(bodies, length), FIELD(bodies, landing), FIELD(bodies, middle),
    STRUCTURE(contact), FIELD(contact, body), FIELD(contact, flying), FIELD(contact, other),
    FIELD(contact, missing), FIELD(contact, time),
};

EXPORT int64_t core_layout(const place **rows)
{
    *rows = PLACES;
    return sizeof PLACES / sizeof *PLACES;
}

/* A hash of the sources; setup.py gives it. */
#ifndef CORE_SOURCES
#define CORE_SOURCES ""
#endif

EXPORT const char *core_sources(void) { return CORE_SOURCES; }
