// Moves the cloth of a scene and prints its positions [m], a line per vertex, frame by frame from
// the start on, with as many digits as an f32 has: the frames that `selvedge run` writes.
//
//     rollout SCENE physics FRAMES      the physics
//     rollout SCENE MODEL FRAMES        a model, by its file or the name of a shipped one
//
// cc -std=c11 -Iinclude examples/rollout.c -o rollout -L../../target/release -lselvedge_c
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "selvedge.h"

// Ends the program with the words for a call that failed.
static void check(SelvedgeStatus status, const char *what) {
    if (status == SELVEDGE_STATUS_OK) return;
    fprintf(stderr, "%s: %s (%s)\n", what, selvedge_last_error(), selvedge_status_text(status));
    exit(1);
}

// Tells how far a long call has come. Another answer than 0 would stop it.
static int32_t tell(void *context, const char *task, uint64_t done, uint64_t goal) {
    (void)context;
    (void)goal;
    if (done % 100 == 0 && done > 0) fprintf(stderr, "%s: %llu\n", task, (unsigned long long)done);
    return 0;
}

static void print_positions(SelvedgeStepper stepper) {
    const float *positions;
    size_t vertices;
    check(selvedge_positions(stepper, &positions, &vertices), "positions");
    for (const float *p = positions; p < positions + 3 * vertices; p += 3)
        printf("%.9g %.9g %.9g\n", p[0], p[1], p[2]);
}

// Makes the stepper, and gives up what it no longer needs.
static SelvedgeStepper open_stepper(const char *scene_name, const char *model_name) {
    SelvedgeListener listener = {tell, NULL};
    SelvedgeScene scene;
    SelvedgeStepper stepper;
    check(selvedge_scene_open(scene_name, &scene), "scene");
    if (strcmp(model_name, "physics") == 0) {
        check(selvedge_stepper_physics(scene, &listener, &stepper), "physics");
    } else {
        SelvedgeModel model;
        check(selvedge_model_open(model_name, &model), "model");
        check(selvedge_stepper_model(scene, model, SELVEDGE_GUARD_LIMIT, &listener, &stepper),
              "stepper");
        check(selvedge_model_free(model), "model");
    }
    check(selvedge_scene_free(scene), "scene");
    return stepper;
}

int main(int count, char **words) {
    if (count != 4) {
        fprintf(stderr, "usage: rollout SCENE physics|MODEL FRAMES\n");
        return 2;
    }
    if (selvedge_interface() != SELVEDGE_INTERFACE) {
        fprintf(stderr, "the header is not that of the library\n");
        return 1;
    }
    SelvedgeStepper stepper = open_stepper(words[1], words[2]);
    SelvedgeCounts counts;
    check(selvedge_stepper_counts(stepper, &counts), "counts");
    // A program of its own would put here where its handles are to go.
    double *targets = calloc(counts.samples * counts.handles * 3 + 1, sizeof *targets);
    uint8_t *released = calloc(counts.handles + 1, sizeof *released);
    if (targets == NULL || released == NULL) return 1;
    print_positions(stepper);
    for (long frame = strtol(words[3], NULL, 10); frame > 0; frame--) {
        check(selvedge_motion_targets(stepper, targets, counts.samples, counts.handles, released),
              "motion");
        check(selvedge_step(stepper, targets, counts.samples, counts.handles, released), "step");
        print_positions(stepper);
    }
    free(targets);
    free(released);
    check(selvedge_stepper_free(stepper), "stepper");
    return 0;
}
