/*
 * Pushes a recorded dive into a saved navigator, and prints the state and a sum of all that it then saves: the same bits on every
 * machine. With "time" it prints what a push takes instead, and the part of a core that all of them take of the dive's time, with state
 * and covariance read 20 times a second.
 *
 *     dive NAVIGATOR EVENTS [time]
 *
 * EVENTS are records of 14 numbers of 8 bytes: kind, time in ns (both integers), and 12 doubles, of which a kind has the first.
 */
#define _POSIX_C_SOURCE 199309L
#include "bottomlock.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

struct event {
    int64_t kind, time_ns;
    double numbers[12];
};

static void fail(const char *what) {
    fprintf(stderr, "%s: %s\n", what, bl_last_error());
    exit(1);
}

static unsigned char *content(const char *path, size_t *size) {
    FILE *file = fopen(path, "rb");
    if (!file || fseek(file, 0, SEEK_END)) fail(path);
    *size = (size_t)ftell(file);
    unsigned char *bytes = malloc(*size);
    rewind(file);
    if (!bytes || fread(bytes, 1, *size, file) != *size) fail(path);
    fclose(file);
    return bytes;
}

static bl_status push(bl_navigator *navigator, const struct event *event) {
    const double *v = event->numbers;
    uint8_t valid[4];
    switch (event->kind) {
    case 0: return bl_push_imu(navigator, event->time_ns, v, v + 3);
    case 1:
        for (int beam = 0; beam < 4; beam++) valid[beam] = v[4 + beam] != 0.0;
        return bl_push_beams(navigator, event->time_ns, 4, v, valid, v + 8);
    case 2: return bl_push_depth(navigator, event->time_ns, v[0], v[1]);
    case 3: return bl_push_attitude(navigator, event->time_ns, v, v[4], v[5]);
    default: exit(2);
    }
}

static double now_us(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec * 1e6 + (double)time.tv_nsec * 1e-3;
}

static int rising(const void *one, const void *other) {
    const double a = *(const double *)one, b = *(const double *)other;
    return (a > b) - (a < b);
}

/* State and covariance, where another twentieth of a second has begun; what that takes. */
static double read_estimate(const bl_navigator *navigator, int64_t time_ns) {
    static int64_t last = -1;
    bl_state state;
    double covariance[400];
    const int64_t tick = time_ns / 50000000;
    if (tick == last) return 0.0;
    last = tick;
    const double start_us = now_us();
    if (bl_navigator_state(navigator, &state) != BL_STATUS_OK) fail("state");
    if (bl_navigator_covariance(navigator, covariance) != BL_STATUS_OK) fail("covariance");
    return now_us() - start_us;
}

static void print_times(double *took_us, size_t count, double read_us, double dive_us) {
    double sum_us = read_us;
    for (size_t k = 0; k < count; k++) sum_us += took_us[k];
    qsort(took_us, count, sizeof *took_us, rising);
    printf("pushes %zu median_us %.2f p99_us %.2f greatest_us %.2f core_percent %.4f\n", count, took_us[count / 2],
           took_us[(size_t)((double)count * 0.99)], took_us[count - 1], 100.0 * sum_us / dive_us);
}

static void print_bits(const bl_navigator *navigator) {
    bl_state state;
    size_t size = 0;
    if (bl_navigator_state(navigator, &state) != BL_STATUS_OK) fail("state");
    bl_navigator_save(navigator, NULL, 0, &size);
    unsigned char *bytes = malloc(size);
    if (!bytes || bl_navigator_save(navigator, bytes, size, &size) != BL_STATUS_OK) fail("save");
    uint64_t sum = UINT64_C(14695981039346656037); /* FNV-1a */
    for (size_t k = 0; k < size; k++) sum = (sum ^ bytes[k]) * UINT64_C(1099511628211);
    printf("position %a %a %a\nvelocity %a %a %a\nsaved %zu %016llx\n", state.position_t_m[0], state.position_t_m[1],
           state.position_t_m[2], state.velocity_p_mps[0], state.velocity_p_mps[1], state.velocity_p_mps[2], size,
           (unsigned long long)sum);
    free(bytes);
}

int main(int count, char **words) {
    if (count < 3) return fprintf(stderr, "dive NAVIGATOR EVENTS [time]\n"), 2;
    size_t size, events_size;
    unsigned char *saved = content(words[1], &size), *read = content(words[2], &events_size);
    const struct event *events = (const struct event *)read;
    const size_t pushes = events_size / sizeof *events;
    bl_navigator *navigator = bl_navigator_load(saved, size);
    double *took_us = calloc(pushes, sizeof *took_us);
    if (!navigator || !took_us || !pushes) fail("load");
    const int is_timed = count > 3 && !strcmp(words[3], "time");
    double read_us = 0.0;
    for (size_t k = 0; k < pushes; k++) {
        const double start_us = now_us();
        if (push(navigator, events + k) != BL_STATUS_OK) fail("push");
        took_us[k] = now_us() - start_us;
        if (is_timed) read_us += read_estimate(navigator, events[k].time_ns);
    }
    if (is_timed)
        print_times(took_us, pushes, read_us, (double)(events[pushes - 1].time_ns - events[0].time_ns) * 1e-3);
    else
        print_bits(navigator);
    bl_navigator_free(navigator);
    free(took_us);
    free(saved);
    free(read);
    return 0;
}
