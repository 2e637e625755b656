"""The steps of a layout that takes many of them in one launch, in terms of its passes."""

__all__ = ["STEPS"]

# What a layout must define before: its passes `euler`, `kick_and_drift`, `gradient_shift`; what it
# does around the steps and around a look, `prepare`, `begin`, `end`, `check`; `begin_step` and
# `middle_of_step`, which follow the clock; its oscillators; the ledger's `enter_work`.
STEPS = r"""
const long long past = (long long)last_step * division_;
prepare();
begin();
bool gone = all_stopped();  // nobody is left to step, now or later
for (long long n = (long long)first_step * division_; n < past; ++n) {
    if (n % CHECK_EVERY == 0) {
        end();
        check(n);
        begin();
        gone = all_stopped();
        if (ACTUATED) set_oscillators(n);
    }
    if (gone) {  // only the clock of the muscles goes on
        const long long latest = (past - 1) / CHECK_EVERY * CHECK_EVERY;
        if (ACTUATED && latest > n) { n = latest; set_oscillators(n); }
        for (; ACTUATED && n < past; ++n) {
            turn_oscillators();
            if (CHIN4) turn_oscillators();
        }
        break;
    }
    const bool start = n == 0;
    const scalar time = EULER ? dt : start ? FIRST_KICK : FIRST_KICK * scalar(2);
    const double now = double(n) * exact_dt, part = exact_dt * (CHIN4 ? 1.0 / 6.0 : 0.5);
    kick_begin = EULER || start ? now : now - part;
    kick_end = EULER ? now + exact_dt : now + part;
    begin_step(now);
    if (EULER) euler();
    else kick_and_drift(false, time, start, !CHIN4);
    if (LEDGER) enter_work(time);
    turn_oscillators();
    if (CHIN4) {
        kick_begin = kick_end;
        kick_end = now + exact_dt - part;
        middle_of_step(now + 0.5 * exact_dt);
        gradient_shift();
        if (LEDGER) enter_work(GRADIENT_KICK);
        kick_and_drift(true, GRADIENT_KICK, false, true);
        power = zero;
        turn_oscillators();
    }
}
end();
"""
