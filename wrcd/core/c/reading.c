/* Frames as they come, without what a core makes of them: for who looks at a log, or at one message. */
#include "core.h"

/* Read frames: of each why it is refused, by its E2E chain or (without `follows`) for itself; -1: it is not mapped. Values go
 * to `sample`, in the frames' order, those of a refused frame as NaN. Returns how many. */
int64_t wrcd_read(const wrcd_train *t, const unsigned char *records, int64_t stride, int64_t frames, int follows,
                  int32_t *reasons, wrcd_sample *sample)
{
    int64_t samples = 0;

    for (int64_t k = 0; k < frames; k++) {
        const wrcd_frame_head *f = (const wrcd_frame_head *)(const void *)(records + k * stride);
        const wrcd_message *m = wrcd_message_of(t, f->word);
        reading values[WRCD_MAX_SIGNALS];
        int count = 0;
        reasons[k] = -1;
        if (m == NULL)
            continue;
        if (!follows)
            wrcd_e2e_reset(&t->message_state[m - t->message]);
        reasons[k] = wrcd_read_frame(t, (int)(m - t->message), f, stride - (int64_t)sizeof *f, values, &count);
        for (int i = 0; reasons[k] == WRCD_REASON_NONE && i < count; i++)
            sample[samples++] = (wrcd_sample){
                f->stamp_us, values[i].value, values[i].input, (int32_t)k, values[i].is_degraded, values[i].is_contested};
        for (int i = m->first_signals; reasons[k] != WRCD_REASON_NONE && i < m->first_signals + m->signals; i++)
            if (wrcd_is_concerned(t, m, i, f, reasons[k]))
                sample[samples++] = (wrcd_sample){f->stamp_us, NAN, i, (int32_t)k, 0, 0};
    }
    return samples;
}
