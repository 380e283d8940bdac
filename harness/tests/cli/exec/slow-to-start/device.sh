# A device without objects but 1000h, which starts later than a scan of a bus would wait.
sleep 4
echo '(0.000000) can0 701#00'
while read -r stamp interface frame; do
    case $frame in
    601#40001000*) echo '(0.000000) can0 581#4300100091010000' ;;
    601#40*)
        rest=${frame#601#40}
        echo "(0.000000) can0 581#80${rest%00000000}00000206"
        ;;
    esac
done
