// Makes the mistakes that a program can make, and prints the code and the words of each: a path
// that leads nowhere, wrong counts, handles that were freed or are of something else, null
// pointers; then four threads with one stepper and with one each. Nothing of it crashes.
//
//     mistakes SCENE
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "selvedge.h"

static int failures;

// Prints the outcome of a call, and counts those that are not as expected.
static void expect(SelvedgeStatus wanted, SelvedgeStatus found, const char *what) {
    const char *words = found == SELVEDGE_STATUS_OK ? "" : selvedge_last_error();
    printf("%s: %d %s\n", what, (int)found, words);
    if (found != wanted || (found != SELVEDGE_STATUS_OK && words[0] == '\0')) {
        printf("  expected %d\n", (int)wanted);
        failures++;
    }
}

static void wrong_names(void) {
    SelvedgeScene scene = 7;
    SelvedgeModel model = 7;
    expect(SELVEDGE_STATUS_OPEN, selvedge_scene_open("nowhere/at-all.toml", &scene), "no scene");
    expect(SELVEDGE_STATUS_OPEN, selvedge_model_open("nowhere/at-all.safetensors", &model),
           "no model");
    expect(SELVEDGE_STATUS_ARGUMENT, selvedge_scene_open("\xff\xfe", &scene), "not UTF-8");
    expect(SELVEDGE_STATUS_OPEN, selvedge_scene_open("", &scene), "an empty name");
    expect(SELVEDGE_STATUS_ARGUMENT, selvedge_keep_rest_poses("/dev/null/poses"),
           "a folder that cannot be written");
    expect(SELVEDGE_STATUS_ARGUMENT, selvedge_scene_open(NULL, &scene), "a null path");
    expect(SELVEDGE_STATUS_ARGUMENT, selvedge_scene_open("default", NULL), "nowhere to write");
    expect(SELVEDGE_STATUS_ARGUMENT, selvedge_set_threads(SIZE_MAX), "threads without end");
    if (scene != 0 || model != 0) failures++;
}

static void wrong_counts(SelvedgeStepper stepper, const SelvedgeCounts *counts) {
    double targets[30] = {0};
    float positions[3];
    uint32_t faces[3];
    size_t handles = counts->handles, needed = 0;
    char text[1];
    expect(SELVEDGE_STATUS_COUNT, selvedge_step(stepper, targets, 1, handles + 1, NULL),
           "a handle too many");
    expect(SELVEDGE_STATUS_ARGUMENT, selvedge_step(stepper, targets, 0, handles, NULL), "no sample");
    expect(SELVEDGE_STATUS_ARGUMENT, selvedge_step(stepper, NULL, 1, handles, NULL), "no targets");
    targets[1] = NAN;
    expect(SELVEDGE_STATUS_ARGUMENT, selvedge_step(stepper, targets, 1, handles, NULL),
           "no number");
    expect(SELVEDGE_STATUS_COUNT, selvedge_copy_positions(stepper, positions, 1), "few positions");
    expect(SELVEDGE_STATUS_COUNT, selvedge_copy_faces(stepper, faces, 1), "few faces");
    expect(SELVEDGE_STATUS_OK, selvedge_stepper_warnings(stepper, NULL, 0, &needed), "a length");
    expect(needed > 1 ? SELVEDGE_STATUS_COUNT : SELVEDGE_STATUS_OK,
           selvedge_stepper_warnings(stepper, text, 1, NULL), "little room");
}

static void wrong_handles(SelvedgeScene scene, SelvedgeModel model) {
    SelvedgeStepper stepper, other;
    SelvedgeTrust trust;
    expect(SELVEDGE_STATUS_OK, selvedge_stepper_physics(scene, NULL, &stepper), "a stepper");
    expect(SELVEDGE_STATUS_ARGUMENT, selvedge_trust(stepper, &trust), "trust of the physics");
    expect(SELVEDGE_STATUS_HANDLE, selvedge_step_along(scene), "a scene is no stepper");
    expect(SELVEDGE_STATUS_HANDLE, selvedge_step_along(0), "0 is no stepper");
    expect(SELVEDGE_STATUS_HANDLE, selvedge_step_along((uint64_t)(size_t)&trust), "an address");
    expect(SELVEDGE_STATUS_HANDLE, selvedge_stepper_model(model, scene, 0, NULL, &other),
           "scene and model exchanged");
    expect(SELVEDGE_STATUS_ARGUMENT, selvedge_stepper_model(scene, model, 77, NULL, &other),
           "no guard");
    expect(SELVEDGE_STATUS_OK, selvedge_stepper_stop(stepper, 1), "stop");
    expect(SELVEDGE_STATUS_STOPPED, selvedge_step_along(stepper), "a step that is to stop");
    expect(SELVEDGE_STATUS_OK, selvedge_stepper_stop(stepper, 0), "go on");
    expect(SELVEDGE_STATUS_OK, selvedge_step_along(stepper), "a step that may go on");
    expect(SELVEDGE_STATUS_OK, selvedge_stepper_free(stepper), "free");
    expect(SELVEDGE_STATUS_FREED, selvedge_step_along(stepper), "step after free");
    expect(SELVEDGE_STATUS_FREED, selvedge_stepper_free(stepper), "free twice");
    expect(SELVEDGE_STATUS_OK, selvedge_stepper_physics(scene, NULL, &other), "another");
    expect(SELVEDGE_STATUS_FREED, selvedge_step_along(stepper), "the old one");
    expect(SELVEDGE_STATUS_OK, selvedge_stepper_free(other), "free");
}

typedef struct {
    SelvedgeScene scene;
    SelvedgeStepper shared;
    float *end; // positions of the thread's own stepper
    size_t vertices;
} Work;

static void *steps(void *argument) {
    Work *work = argument;
    SelvedgeStepper own;
    if (selvedge_stepper_physics(work->scene, NULL, &own) != SELVEDGE_STATUS_OK) return work;
    for (int frame = 0; frame < 5; frame++) {
        if (selvedge_step_along(own) != SELVEDGE_STATUS_OK) return work;
        if (selvedge_step_along(work->shared) != SELVEDGE_STATUS_OK) return work;
    }
    // An error of this thread is not that of another.
    if (selvedge_step_along(0) != SELVEDGE_STATUS_HANDLE) return work;
    if (selvedge_copy_positions(own, work->end, work->vertices) != SELVEDGE_STATUS_OK) return work;
    return selvedge_stepper_free(own) == SELVEDGE_STATUS_OK ? NULL : work;
}

static void threads(SelvedgeScene scene) {
    enum { THREADS = 4 };
    SelvedgeStepper shared;
    SelvedgeCounts counts;
    Work work[THREADS];
    pthread_t started[THREADS];
    expect(SELVEDGE_STATUS_OK, selvedge_stepper_physics(scene, NULL, &shared), "for all threads");
    expect(SELVEDGE_STATUS_OK, selvedge_stepper_counts(shared, &counts), "counts");
    size_t bytes = counts.vertices * 3 * sizeof(float);
    for (int k = 0; k < THREADS; k++) {
        work[k] = (Work){scene, shared, malloc(bytes), counts.vertices};
        if (pthread_create(&started[k], NULL, steps, &work[k]) != 0) abort();
    }
    for (int k = 0; k < THREADS; k++) {
        void *failed = NULL;
        pthread_join(started[k], &failed);
        if (failed != NULL || memcmp(work[0].end, work[k].end, bytes) != 0) failures++;
    }
    for (int k = 0; k < THREADS; k++) free(work[k].end);
    expect(SELVEDGE_STATUS_OK, selvedge_stepper_counts(shared, &counts), "counts");
    printf("%d frames by %d threads\n", (int)counts.frame, THREADS);
    if (counts.frame != 5 * THREADS) failures++;
    expect(SELVEDGE_STATUS_OK, selvedge_stepper_free(shared), "free");
}

int main(int count, char **words) {
    SelvedgeScene scene;
    SelvedgeModel model;
    SelvedgeStepper stepper;
    SelvedgeCounts counts;
    SelvedgeTrust trust;
    if (count != 2) return 2;
    wrong_names();
    expect(SELVEDGE_STATUS_OK, selvedge_scene_open(words[1], &scene), "a scene");
    expect(SELVEDGE_STATUS_OK, selvedge_model_open(NULL, &model), "the shipped model");
    expect(SELVEDGE_STATUS_OK, selvedge_stepper_model(scene, model, 0, NULL, &stepper), "a stepper");
    expect(SELVEDGE_STATUS_OK, selvedge_stepper_counts(stepper, &counts), "counts");
    wrong_counts(stepper, &counts);
    expect(SELVEDGE_STATUS_OK, selvedge_step_along(stepper), "a step");
    expect(SELVEDGE_STATUS_OK, selvedge_trust(stepper, &trust), "trust");
    if (trust.frame != 1 || !(trust.largest_strain < 1.0)) failures++;
    wrong_handles(scene, model);
    threads(scene);
    expect(SELVEDGE_STATUS_OK, selvedge_stepper_free(stepper), "free");
    expect(SELVEDGE_STATUS_OK, selvedge_model_free(model), "free");
    expect(SELVEDGE_STATUS_OK, selvedge_scene_free(scene), "free");
    printf("%d not as expected\n", failures);
    return failures == 0 ? 0 : 1;
}
