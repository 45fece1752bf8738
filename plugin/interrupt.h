/// Ctrl-C while a tree is being built: the build is cancelled, then the signal goes where it would have gone.
#pragma once

#include <atomic>
#include <csignal>

#include "build_monitor.h"

/// Cancels `monitor` on SIGINT while it lives. When it ends, the previous handler is back, and gets a signal that came
/// meanwhile: Python's then raises KeyboardInterrupt as soon as Python code runs again.
class InterruptWatch {
public:
    explicit InterruptWatch(bsp::BuildMonitor &monitor) {
        bsp::BuildMonitor *none = nullptr;
        m_active = watched().compare_exchange_strong(none, &monitor); // nested builds: the outer one watches
        if (!m_active)
            return;
        interrupted() = false;
        struct sigaction action{};
        action.sa_handler = [](int) {
            interrupted() = true;
            if (bsp::BuildMonitor *const current = watched())
                current->cancel();
        };
        sigaction(SIGINT, &action, &m_previous);
    }

    ~InterruptWatch() {
        if (!m_active)
            return;
        sigaction(SIGINT, &m_previous, nullptr);
        watched() = nullptr;
        if (interrupted())
            std::raise(SIGINT);
    }

    InterruptWatch(const InterruptWatch &) = delete;
    InterruptWatch &operator=(const InterruptWatch &) = delete;

private:
    static std::atomic<bsp::BuildMonitor *> &watched() {
        static std::atomic<bsp::BuildMonitor *> monitor{nullptr};
        return monitor;
    }
    static std::atomic<bool> &interrupted() {
        static std::atomic<bool> flag{false};
        return flag;
    }

    bool m_active = false;
    struct sigaction m_previous{};
};
