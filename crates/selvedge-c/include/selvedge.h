// Selvedge for C: scenes, models and steppers behind handles. Made by cbindgen from the sources of
// the crate selvedge-c; not to be edited.
//
// SPDX-License-Identifier: MIT OR Apache-2.0
//
// Every function may be called from any thread. Calls with one handle wait for one another; calls
// with different handles run side by side. The guide "C" of the book says more.

#ifndef SELVEDGE_H
#define SELVEDGE_H

#include <stddef.h>
#include <stdint.h>

// Number of this interface; another number has other functions or structures.
#define SELVEDGE_INTERFACE 1

// Outcome of a call; `selvedge_last_error` has the words where it is not `SELVEDGE_STATUS_OK`.
enum SelvedgeStatus
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Done.
  SELVEDGE_STATUS_OK = 0,
  // An argument that cannot be used: a null pointer, a text that is not UTF-8, a number that
  // means nothing.
  SELVEDGE_STATUS_ARGUMENT = 1,
  // An array of another length than the cloth has, or a text that does not fit.
  SELVEDGE_STATUS_COUNT = 2,
  // A number that is no handle, or the handle of something else.
  SELVEDGE_STATUS_HANDLE = 3,
  // A handle that was freed.
  SELVEDGE_STATUS_FREED = 4,
  // A handle whose last call panicked: it can only be freed.
  SELVEDGE_STATUS_POISONED = 5,
  // A scene or a model that cannot be opened.
  SELVEDGE_STATUS_OPEN = 6,
  // A scene that cannot be made ready to move, or not by this model.
  SELVEDGE_STATUS_START = 7,
  // A step that failed; the cloth is where it was before it.
  SELVEDGE_STATUS_STEP = 8,
  // A listener, or `selvedge_stepper_stop`, asked to stop.
  SELVEDGE_STATUS_STOPPED = 9,
  // A defect of Selvedge: a call panicked.
  SELVEDGE_STATUS_PANIC = 10,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SelvedgeStatus SelvedgeStatus;
#else
typedef int32_t SelvedgeStatus;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Correction of frames that no cloth could have. `SELVEDGE_GUARD_LIMIT` is that of the command
// line where nothing else is said.
enum SelvedgeGuard
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Edges are brought back within bounds; what is lost is replaced by the physics.
  SELVEDGE_GUARD_LIMIT = 0,
  // No correction: frames are measured.
  SELVEDGE_GUARD_NONE = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SelvedgeGuard SelvedgeGuard;
#else
typedef int32_t SelvedgeGuard;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Judgement of a frame in one word.
enum SelvedgeVerdict
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Within all bounds, as it was predicted.
  SELVEDGE_VERDICT_HELD = 0,
  // Beyond a bound and brought back; without correction, left as it was.
  SELVEDGE_VERDICT_CORRECTED = 1,
  // Not correctable, and replaced.
  SELVEDGE_VERDICT_LOST = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SelvedgeVerdict SelvedgeVerdict;
#else
typedef int32_t SelvedgeVerdict;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Origin of the frame that was given on in the place of a lost one.
enum SelvedgeReplacement
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // None: the frame was not lost, or nothing is corrected.
  SELVEDGE_REPLACEMENT_NOTHING = 0,
  // A step of the physics.
  SELVEDGE_REPLACEMENT_PHYSICS = 1,
  // The last frame, carried rigidly by the handles.
  SELVEDGE_REPLACEMENT_CARRY = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SelvedgeReplacement SelvedgeReplacement;
#else
typedef int32_t SelvedgeReplacement;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Contact on the way to a frame.
enum SelvedgeContact
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Nothing met, or the scene has no contact.
  SELVEDGE_CONTACT_FREE = 0,
  // Vertices were pushed apart.
  SELVEDGE_CONTACT_PUSHED = 1,
  // Pushing did not end: the frame counts as lost.
  SELVEDGE_CONTACT_LOST = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SelvedgeContact SelvedgeContact;
#else
typedef int32_t SelvedgeContact;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Handle of a model; 0 is none.
typedef uint64_t SelvedgeModel;

// Handle of a scene; 0 is none.
typedef uint64_t SelvedgeScene;

// Handle of a stepper, a cloth that moves one frame at a time; 0 is none.
typedef uint64_t SelvedgeStepper;

// Handle of a snapshot, a state of a stepper in memory; 0 is none.
typedef uint64_t SelvedgeSnapshot;

// A listener of a long call: hears what is done and may stop it.
//
// `hear` is called with `context`, the task in words ("sagging to rest"; only during the call),
// the units that are done and those that there are, 0 where that is not known. It returns 0 to go
// on and anything else to stop. It may be called from other threads than the caller's, one call
// at a time, must not call with the handle that the long call has, and must not throw or jump
// out.
typedef struct SelvedgeListener {
  // The function; null hears nothing.
  int32_t (*hear)(void *context, const char *task, uint64_t done, uint64_t goal);
  // Whatever the function is to have.
  void *context;
} SelvedgeListener;

// Counts of a stepper.
typedef struct SelvedgeCounts {
  // Vertices of the cloth.
  uint64_t vertices;
  // Faces of the cloth, triangles.
  uint64_t faces;
  // Handles, the vertices that are led.
  uint64_t handles;
  // Targets per frame with which the command line drives such a stepper: one per substep of the
  // physics, one for a model.
  uint64_t samples;
  // Frames that the motion of the scene lasts.
  uint64_t motion_frames;
  // Frames since the start; a scene that starts in a saved state begins with its frame.
  uint64_t frame;
  // Frames per second.
  double frame_rate;
} SelvedgeCounts;

// Word of the guard on the newest frame.
typedef struct SelvedgeTrust {
  // Number of the frame, counted from the start.
  uint64_t frame;
  // A `SelvedgeVerdict`.
  int32_t verdict;
  // A `SelvedgeReplacement`.
  int32_t replaced_by;
  // A `SelvedgeContact`.
  int32_t contact;
  // 1 where the physics was asked for this frame and failed, otherwise 0.
  int32_t physics_failed;
  // Largest strain (l - l0)/l0 of an edge of the frame that was given on.
  double largest_strain;
  // Smallest strain of an edge.
  double smallest_strain;
  // Root of the mean squared strain over all edges.
  double strain_rms;
  // Kinetic energy over mass `[J/kg]`.
  double kinetic_energy;
  // Largest speed of a vertex `[m/s]`.
  double largest_speed;
  // Largest strain of the prediction; not a number where there is none.
  double predicted_strain;
  // Root of the mean squared move of a vertex from the prediction `[m]`; not a number without
  // one.
  double correction_rms;
  // Largest move of a vertex from the prediction `[m]`; not a number without one.
  double correction_largest;
} SelvedgeTrust;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Opens a model by the path of its file or by the name of a shipped one ("paper");
// null opens the one that the command line takes.
//
// # Safety
// `path_or_name` is null or a text that ends with a zero byte; `out` may be written.
SelvedgeStatus selvedge_model_open(const char *path_or_name, SelvedgeModel *out);

// Frees a model. Steppers that were made of it go on.
SelvedgeStatus selvedge_model_free(SelvedgeModel model);

// Returns the number of the interface that this library has, to be compared with
// `SELVEDGE_INTERFACE` of the header.
uint32_t selvedge_interface(void);

// Returns the version of Selvedge, a text for as long as the library is loaded.
const char *selvedge_version(void);

// Returns the words for the last call of this thread that failed: what of which file, field, frame
// or vertex was wrong, and what to do. They stay until the next call of this thread fails.
const char *selvedge_last_error(void);

// Returns the words for a `SelvedgeStatus` alone, a text for as long as the library is loaded.
const char *selvedge_status_text(int32_t status);

// Sets the number of threads on which all steppers work together; as many as the machine has,
// where nothing is said. Results are the same for any number. Only possible before the first
// stepper is made, and once.
SelvedgeStatus selvedge_set_threads(size_t threads);

// Keeps rest poses that took a while in a folder, from now on: the same cloth then starts at once
// another time, with the same bytes. Without it, nothing is kept. Only the first call counts. The
// folder is created if it is not there; one that cannot be written is an argument error.
//
// # Safety
// `folder` is a text that ends with a zero byte.
SelvedgeStatus selvedge_keep_rest_poses(const char *folder);

// Opens a scene by the path of its file or by the name of a shipped one ("default").
//
// # Safety
// `path_or_name` is a text that ends with a zero byte; `out` may be written.
SelvedgeStatus selvedge_scene_open(const char *path_or_name, SelvedgeScene *out);

// Writes what the scene asks for and cannot have, or hardly means, a line each.
//
// `needed` gets the bytes that the text takes with its zero byte; `text` is filled where it has
// room for so many, and may be null to ask for their number only.
//
// # Safety
// `text` is null or has `room` bytes; `needed` is null or may be written.
SelvedgeStatus selvedge_scene_warnings(SelvedgeScene scene,
                                       char *text,
                                       size_t room,
                                       size_t *needed);

// Frees a scene. Steppers that were made of it go on.
SelvedgeStatus selvedge_scene_free(SelvedgeScene scene);

// Takes a snapshot of a stepper as it is now.
//
// # Safety
// `out` may be written.
SelvedgeStatus selvedge_stepper_snapshot(SelvedgeStepper stepper, SelvedgeSnapshot *out);

// Takes a stepper back to a snapshot of it, or of another stepper of the same scene by the same
// mover: the frames that follow have the bytes of those that followed then. It may be gone back to
// any number of times. Any other snapshot is an error, and the stepper stays as it was.
SelvedgeStatus selvedge_stepper_restore(SelvedgeStepper stepper, SelvedgeSnapshot snapshot);

// Takes a stepper back to where it began.
SelvedgeStatus selvedge_stepper_reset(SelvedgeStepper stepper);

// Frees a snapshot.
SelvedgeStatus selvedge_snapshot_free(SelvedgeSnapshot snapshot);

// Makes a stepper of the physics of a scene, where the scene starts: what `selvedge run`
// runs. A rest pose is searched for first, which may take a while; it is kept for the other
// steppers of the scene.
//
// # Safety
// `listener` is null or a listener that lives during the call; `out` may be written.
SelvedgeStatus selvedge_stepper_physics(SelvedgeScene scene,
                                        const struct SelvedgeListener *listener,
                                        SelvedgeStepper *out);

// Makes a stepper of a model on a scene, from the rest pose of the scene on: what
// `selvedge run --model` runs. `guard` is a `SelvedgeGuard`; 0 is that of the command line.
//
// # Safety
// `listener` is null or a listener that lives during the call; `out` may be written.
SelvedgeStatus selvedge_stepper_model(SelvedgeScene scene,
                                      SelvedgeModel model,
                                      int32_t guard,
                                      const struct SelvedgeListener *listener,
                                      SelvedgeStepper *out);

// Moves the cloth by one frame, its handles to `targets` `[m]`, `[samples][handles][3]`: where
// they are at equally spaced times of the frame, the last at its end. One sample is enough;
// handles move evenly between samples. `released`, `[handles]` or null, is not 0 for handles that
// do not hold the cloth during this frame, which physics can follow, and networks without a rest
// pose that their handles carry along.
//
// A step that fails leaves the cloth as it was before it.
//
// # Safety
// `targets` has `samples * handles * 3` numbers, `released` is null or has `handles` bytes.
SelvedgeStatus selvedge_step(SelvedgeStepper stepper,
                             const double *targets,
                             size_t samples,
                             size_t handles,
                             const uint8_t *released);

// Moves the cloth by one frame, its handles as the motion of the scene has them: what the command
// line does. Past the end of the motion the handles stay where they are.
SelvedgeStatus selvedge_step_along(SelvedgeStepper stepper);

// Leads the body of this number in the scene, from 0, in the next frame away from its own path, by
// the rigid motion of the 4×4 matrix, by columns. It stays there until it is led on. The number of no
// body is `SELVEDGE_STATUS_ARGUMENT`, and so is every number without a solver.
//
// # Safety
// `matrix` has 16 numbers.
SelvedgeStatus selvedge_stepper_lead_body(SelvedgeStepper stepper,
                                          size_t body,
                                          const double *matrix);

// Sets the cloth elsewhere between two frames, as a character that appears in another place, by the
// rigid motion of the 4×4 matrix, by columns; the `count` `bodies` of these numbers go along. The
// cloth swings on as it did. Where it would meet a body, or is moved by a model, it stays.
//
// # Safety
// `matrix` has 16 numbers, `bodies` has `count`.
SelvedgeStatus selvedge_stepper_teleport(SelvedgeStepper stepper,
                                         const double *matrix,
                                         const size_t *bodies,
                                         size_t count);

// Writes the targets of the next step as the motion of the scene has them, in the form that
// `selvedge_step` takes: `targets` `[m]`, `[samples][handles][3]`, and `released`, `[handles]` or
// null. With the `samples` of `SelvedgeCounts`, they move the cloth as the command line does.
//
// # Safety
// `targets` has room for `samples * handles * 3` numbers, `released` is null or has room for
// `handles` bytes.
SelvedgeStatus selvedge_motion_targets(SelvedgeStepper stepper,
                                       double *targets,
                                       size_t samples,
                                       size_t handles,
                                       uint8_t *released);

// Lets the steps of this stepper end with `SELVEDGE_STATUS_STOPPED`, the one under way too, within
// a frame where a frame takes long; with `wanted` 0, lets them go on again. It does not wait for
// the step that another thread has under way.
SelvedgeStatus selvedge_stepper_stop(SelvedgeStepper stepper, int32_t wanted);

// Frees a stepper. Positions that were borrowed from it are no longer to be read.
SelvedgeStatus selvedge_stepper_free(SelvedgeStepper stepper);

// Writes the counts of a stepper.
//
// # Safety
// `out` may be written.
SelvedgeStatus selvedge_stepper_counts(SelvedgeStepper stepper, struct SelvedgeCounts *out);

// Lends the positions `[m]`, `[vertices][3]`, without a copy: `out` gets their address, `vertices`
// how many there are. They may be read until the next call that moves this stepper (a step,
// a teleport, a way back) or frees it, from whichever thread; whoever cannot rule that out copies them.
//
// # Safety
// `out` and `vertices` may be written.
SelvedgeStatus selvedge_positions(SelvedgeStepper stepper,
                                  const float **out,
                                  size_t *vertices);

// Copies the positions `[m]` to `out`, `[vertices][3]`.
//
// # Safety
// `out` has room for `3 * vertices` numbers.
SelvedgeStatus selvedge_copy_positions(SelvedgeStepper stepper, float *out, size_t vertices);

// Copies the positions `[m]` to `out`, `[vertices][3]`: those of the state of the physics, which
// has more digits than frames have, and those of a model as they are.
//
// # Safety
// `out` has room for `3 * vertices` numbers.
SelvedgeStatus selvedge_copy_positions_f64(SelvedgeStepper stepper, double *out, size_t vertices);

// Copies what each body of the scene received from the cloth in the last frame to `out`, `[bodies][6]`:
// momentum `[N s]`, and angular momentum about the origin `[N m s]`; times the frame rate, force and torque.
// Of a model, and of a scene without contact, there are none.
//
// # Safety
// `out` has room for `6 * bodies` numbers.
SelvedgeStatus selvedge_copy_impulses(SelvedgeStepper stepper,
                                      double *out,
                                      size_t bodies);

// Copies the faces to `out`, `[faces][3]`: numbers of their vertices, counterclockwise where they
// are seen from the front.
//
// # Safety
// `out` has room for `3 * faces` numbers.
SelvedgeStatus selvedge_copy_faces(SelvedgeStepper stepper, uint32_t *out, size_t faces);

// Copies the vertices of the handles to `out`, `[handles]`, in the order in which a step takes
// their targets.
//
// # Safety
// `out` has room for `handles` numbers.
SelvedgeStatus selvedge_copy_handles(SelvedgeStepper stepper, uint32_t *out, size_t handles);

// Writes the guard's word on the newest frame of a model.
//
// # Safety
// `out` may be written.
SelvedgeStatus selvedge_trust(SelvedgeStepper stepper, struct SelvedgeTrust *out);

// Writes what is to be known of a stepper so far, a line each: the warnings of its scene, what of
// the scene a model does not do, what goes beyond the model's training, edges that strain by more
// than 50 %, and bodies that were let through the cloth. `text`, `room` and
// `needed` are those of `selvedge_scene_warnings`.
//
// # Safety
// `text` is null or has `room` bytes; `needed` is null or may be written.
SelvedgeStatus selvedge_stepper_warnings(SelvedgeStepper stepper,
                                         char *text,
                                         size_t room,
                                         size_t *needed);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SELVEDGE_H */
